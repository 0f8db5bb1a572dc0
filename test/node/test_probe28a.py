"""probes"""
from __future__ import annotations
import math, time, threading
import numpy as np, pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from std_srvs.srv import SetBool, Trigger
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from gdfe_ros.node.messages import to_time

def pose(z=0.0, x=0.0, frame="", stamp=None, w=1.0):
    m = PoseStamped(); m.header.frame_id = frame
    if stamp is not None: m.header.stamp = to_time(stamp)
    m.pose.position.x, m.pose.position.z = float(x), float(z)
    m.pose.orientation.w = float(w)
    return m

def test_followed_pose(client, start, coarse):
    p = start(**coarse, follow=["tip=topic:/tool_pose"], command_max_age=10.0)
    pub = client.node.create_publisher(PoseStamped, "/tool_pose", 100)
    client.wait(lambda: pub.get_subscription_count() and client.received["mesh"], seconds=30)
    tip = client.received["handles/tip/pose"]
    now = time.time_ns()
    cells = client.mesh(); L = cells[:,0].max(); rest = cells[cells[:,0] > L-1e-6,:3].mean(axis=0)
    def place(z=0.0, **more):
        m = pose(rest[2]+z, rest[0], **more); m.pose.position.y = float(rest[1]); return m
    pub.publish(place(0.02, stamp=now))
    client.wait(lambda: tip and abs(tip[-1].pose.position.z-0.02)<1e-6, seconds=30)
    for m in (place(math.nan), place(math.inf), place(0, w=0.0), place(0, w=math.nan),
              place(0, stamp=now+1000*10**9), place(0, stamp=now-100*10**9), place(0, frame="nowhere"), place(1e6),
              place(1e308), place(0.07, stamp=now-10**9)):
        pub.publish(m)
    client.spin(2.0)
    d = client.diagnostics()
    print({k: v for k, v in d.items() if "efus" in k or k in ("state", "message", "steps failed", "tip follows")})
    print(tip[-1].pose.position)
    pub.publish(place(0.03, stamp=now+10**8))
    client.wait(lambda: tip and abs(tip[-1].pose.position.z-0.03)<1e-6, seconds=30)
    print(p.log)

def test_failing(client, start):
    p = start(scene="drop", scene_overrides=["dynamics.step=0.001"], clock="lockstep", dt=0.01, record=True, bag_path="/tmp/hn/bagf_%d" % time.time_ns())
    client.wait(client.records)
    t = time.time(); n = 0
    while n < 300:
        client.set(dt=1000.0)
        r = client.call(Trigger, "step", Trigger.Request()); assert not r.success
        if n == 0: print(r.message)
        client.set(dt=0.01)
        if n % 2: assert client.call(SetBool, "pause", SetBool.Request(data=False)).success
        r = client.call(Trigger, "step", Trigger.Request()); assert r.success, r.message
        n += 1
    print("300 in", time.time() - t)
    d = client.diagnostics()
    print({k: d[k] for k in ("state", "steps", "steps failed", "message", "level")})
    print(p.stop())
    print(p.log[-1500:])
