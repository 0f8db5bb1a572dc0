# SPDX-License-Identifier: Apache-2.0
"""Examples of each kind of entry of a scene file, as YAML text; together they use every key."""

from __future__ import annotations

from gdfe_ros.constraints.form import Box, Capsule, Cylinder, Sphere
from gdfe_ros.materials import ArrudaBoyce, Gent, Linear, MooneyRivlin, NeoHookean, Ogden, StableNeoHookean, Yeoh
from gdfe_ros.mesh.selection import BoxSelection, SphereSelection, Where
from gdfe_ros.scene import program
from gdfe_ros.scene.schemas import (
    actuator_schema,
    arm_schema,
    generator_schema,
    material_schema,
    mesh_schema,
    obstacle_schema,
)
from gdfe_ros.scene.schemas import scene_schema as schema
from gdfe_ros.scene.schemas.material_schema import LAW_MODELS
from gdfe_ros.solver.settings import Branch, Damping, Dynamics, SolverSettings

SCENE = """\
name: soft_arm
description: A bar with a stiff tip, pulled by a tendon.
mesh: {bar: {size: [0.20, 0.05, 0.05], cells: [8, 2, 2]}}
materials:
  soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1100}
  stiff: {law: linear, young: 1.0e6, poisson: 0.40, density: 1200}
regions:
  - {material: soft}
  - {material: stiff, where: {box: {x: [0.15, 0.20]}}}
handles:
  base: {where: {face: x-}, fixed: true}
obstacles:
  table: {plane: [0, 0, 1], at: [0, 0, -0.10], friction: 0.5}
bodies:
  part: {box: {size: [0.02, 0.02, 0.02]}, density: 800, at: [0.1, 0, -0.09], friction: 0.5}
  ball: {sphere: {radius: 0.01}, mass: 0.02, at: [0.15, 0, -0.09], friction: 0.5}
soft_bodies:
  cube: {bar: {size: [0.02, 0.02, 0.02], cells: [2, 2, 2]}, material: soft, at: [0.05, 0, -0.085]}
actuators:
  tendon: {cable: {points: [[0.0, 0.0, 0.02], [0.2, 0.0, 0.02]], command: tension, range: [0.0, 20.0]}}
loads:
  weight: {gravity: [0, 0, -9.81]}
fibres:
  paper: {where: {face: z-}, along: [1, 0, 0], angles_deg: [0, 60, 120], stiffness: 2.0e4, compression: true}
masses:
  camera: {mass: 0.02, where: {face: x+}}
probes:
  tip: [0.2, 0.0, 0.0]
self_contact: {friction: 0.5}
sensors:
  pad: {where: {face: z-}}
dynamics: {scheme: bdf2, step: 0.01}
program:
  duration: 1.0
  obstacles:
    table: [{time: 1.0, translation: [0, 0, 0.02]}]
  actuators:
    tendon: [{time: 0.0, value: 0.0}, {time: 1.0, value: 5.0}]
solver: {policy: energy, tolerance: 1.0e-4}
"""

ARMED = """\
mesh: {bar: {size: [0.06, 0.02, 0.02], cells: [6, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1100}}
regions: [{material: soft}]
name: hand_on_an_arm
handles: {wrist: {where: {face: x-}}}
loads: {weight: {gravity: [0, 0, -9.81]}}
arm: {urdf: arm.urdf, flange: tool0, handle: wrist, at: [-0.5, 0, 0], start: {lift: 1.57}}
program: {duration: 1.0, joints: {lift: [{time: 1.0, value: 1.2}]}}
"""

TWO_ARMED = """\
mesh: {bar: {size: [0.06, 0.02, 0.02], cells: [6, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1100}}
regions: [{material: soft}]
name: two_arms
handles: {near: {where: {face: x-}}, far: {where: {face: x+}}}
arms:
  left: {urdf: arm.urdf, flange: tool0, handle: near, at: [-0.5, 0, 0]}
  right: {urdf: arm.urdf, flange: right_tool0, handle: far, at: [0.56, 0, 0], rotation_deg: [0, 0, 180], prefix: right_}
"""

SKINNED = """\
mesh: {voxels: {surface: hand.stl, cell: 0.003, cells: cut}}
skin: {file: hand.stl}
name: hand
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
regions: [{material: soft}]
handles: {wrist: {where: {face: x-}, fixed: true}}
"""

SEVERAL = """\
name: pads
meshes:
  left: {bar: {size: [0.02, 0.02, 0.02], cells: [2, 2, 2]}, at: [-0.04, 0, 0]}
  right: {bar: {size: [0.02, 0.02, 0.02], cells: [2, 2, 2]}, at: [0.04, 0, 0], rotation_deg: [0, 0, 180]}
  ball: {sphere: {inner: 0.004, outer: 0.015, cells: [4, 2]}}
materials:
  silicone: {law: neo_hookean, young: 3.0e5, poisson: 0.45, density: 1100}
  rubber: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1000}
regions: [{material: silicone}, {material: rubber, where: {mesh: ball}}]
handles:
  left: {where: {mesh: left, face: x-}}
  right: {where: {mesh: right, face: x-}}
probes: {top: {mesh: ball, at: [0, 0, 0.015]}}
self_contact: {friction: 0.8}
dynamics: {}
"""

KINDS = (
    "bar: {size: [0.20, 0.05, 0.05], cells: [20, 5, 5]}",
    "grid: {x: [0.0, 0.01, 0.03], y: [0.0, 0.01], z: [0.0, 0.01]}",
    "tube: {inner: 0.008, outer: 0.010, length: 0.10, cells: [2, 16, 30]}",
    "ring: {radius: 0.05, section: [0.01, 0.01], cells: [2, 48, 2]}",
    "sphere: {inner: 0.04, outer: 0.05, cells: [6, 2]}",
    "finger: {size: [0.12, 0.02, 0.02], joints: 3, gap: 0.004, web: 0.005, cell: 0.003}",
    "{file: body.msh, scale: 0.001, merge: true, first_order: true}",
    "voxels: {surface: hand.stl, cell: 0.002, scale: 0.001}",
    "tets: {step: finger.step, size: 0.005}",
    "embedded: QUJD   # as bags carry a mesh that came from a file",
)

EXAMPLES: dict[type, tuple[str, ...]] = {
    Dynamics: (
        "{scheme: generalised_alpha, rho_inf: 0.8, step: 0.005, damping: {viscosity: 50.0}, velocity: [0, 0, 0.1], "
        "spin: [0, 0, 1]}",
        "{scheme: bdf2, step: 0.002, prony: [{share: 0.1, time: 0.02}, {share: 0.1, time: 0.2}]}",
    ),
    Damping: ("{mass: 0.5, viscosity: 100.0}",),
    Branch: ("{share: 0.2, time: 0.05}",),
    actuator_schema.MassModel: ("{mass: 0.052, where: {face: x+}}", "{mass: 0.1, probe: tip}"),
    schema.SceneModel: (SCENE, ARMED, TWO_ARMED, SKINNED, SEVERAL),
    mesh_schema.MeshModel: (*KINDS, "{file: right_hand.msh, mirror: y}   # a left hand"),
    mesh_schema.PlacedMeshModel: (
        "{file: finger.msh, skin: {file: finger.stl}, at: [0, 0.05, 0], rotation_deg: [0, 0, 90], mirror: y}",
        *KINDS,
    ),
    schema.SoftBodyModel: (
        "{bar: {size: [0.02, 0.02, 0.02], cells: [3, 3, 3]}, material: soft, at: [0.1, 0, 0.1]}",
        "{sphere: {inner: 0.004, outer: 0.0125, cells: [4, 2]}, regions: [{material: soft}, {material: stiff, where: "
        "{face: z-}}]}",
        "{file: berry.msh, skin: {file: berry.stl}, rotation_deg: [0, 0, 90], mirror: y, material: soft}",
        "{file: body.msh, scale: 0.001, merge: true, first_order: true, material: soft}",
        *(f"{kind}\nmaterial: soft" for kind in KINDS if kind[0] != "{"),
    ),
    generator_schema.BarModel: ("{size: [0.20, 0.05, 0.05], cells: [20, 5, 5], cut: [{box: {x: [0.05, 0.10]}}]}",),
    generator_schema.GridModel: (
        "{x: [0.0, 0.002, 0.018, 0.02], y: [0.0, 0.01], z: [0.0, 0.01], cut: [{sphere: {center: [0, 0, 0], "
        "radius: 0.001}}]}",
    ),
    generator_schema.TubeModel: (
        "{inner: 0.008, outer: 0.010, length: 0.10, cells: [2, 16, 30], cap: 0.002, cap_cells: 1}",
    ),
    generator_schema.RingModel: ("{radius: 0.05, section: [0.01, 0.01], cells: [2, 24, 2], angle: 180}",),
    generator_schema.SphereShellModel: ("{inner: 0.04, outer: 0.05, cells: [6, 2]}",),
    generator_schema.FingerModel: (
        "{size: [0.12, 0.02, 0.02], joints: 3, gap: 0.004, web: 0.005, cell: 0.003, taper: 0.8}",
    ),
    mesh_schema.SkinModel: ("{file: hand.stl, scale: 0.001, contact: true}", "embedded: QUJD   # as bags carry it"),
    mesh_schema.TetsModel: (
        "{step: finger.step, size: 0.005, least_size: 0.001}",
        "{surface: hand.stl, size: 0.004, scale: 0.001}",
    ),
    mesh_schema.VoxelsModel: ("{surface: hand.stl, cell: 0.002, scale: 0.001, cells: cut}",),
    Where: (
        "face: x-                                   # the smallest x of the body",
        "box: {x: [0.0, 0.1], z: [0.0, .inf]}",
        "sphere: {center: [0.0, 0.0, 0.0], radius: 0.01}",
        "vertices: [0, 1, 2]",
        "cells: [0, 1]",
        "set: fixed_nodes                           # a set of the mesh file",
        "{mesh: left, face: x-}                     # the smallest x of one of the `meshes`, as it was made",
        "mesh: left                                 # all of it",
        "any: [{mesh: left, face: x-}, {mesh: right, face: x-}]   # the union of the two",
    ),
    BoxSelection: ("{x: [0.0, 0.1], y: [-0.01, 0.01], z: [0.0, .inf]}",),
    SphereSelection: ("{center: [0.0, 0.0, 0.0], radius: 0.01}",),
    LAW_MODELS[Linear]: ("{law: linear, young: 1.0e5, poisson: 0.45, density: 1100, omega: 0.5}",),
    LAW_MODELS[NeoHookean]: ("{law: neo_hookean, young: 1.0e5, poisson: 0.49, density: 1100, omega: 0.5}",),
    LAW_MODELS[StableNeoHookean]: (
        "{law: stable_neo_hookean, young: 1.0e5, poisson: 0.49, density: 1100, omega: 0.5}",
    ),
    material_schema.PublishedModel: (
        "{published: ecoflex_00_30_gent_membrane, poisson: 0.495, density: 1070, omega: 0.5, scale: 0.8}",
    ),
    LAW_MODELS[Yeoh]: ("{law: yeoh, c10: 0.11e6, c20: 0.02e6, c30: 0.0, poisson: 0.499, density: 1070, omega: 0.5}",),
    LAW_MODELS[MooneyRivlin]: (
        "{law: mooney_rivlin, c10: 0.14e6, c01: 0.06e6, poisson: 0.499, density: 1070, omega: 0.5}",
    ),
    LAW_MODELS[ArrudaBoyce]: (
        "{law: arruda_boyce, mu: 0.2e6, lambda_m: 3.0, poisson: 0.499, density: 1070, omega: 0.5}",
    ),
    LAW_MODELS[Gent]: ("{law: gent, mu: 31.7e3, jm: 39.6, poisson: 0.499, density: 1070, omega: 0.5}",),
    LAW_MODELS[Ogden]: (
        "{law: ogden, mu: [0.187e6, 0.092e6, 3.397e6], alpha: [1.94, 4.01, -1.51], poisson: 0.495, density: 1200, "
        "omega: 0.5}",
    ),
    material_schema.CurveModel: (
        "{law: curve, coefficients: [8.67e6, -15.7e6, 15.02e6], strain_max: 0.5, poisson: 0.495, density: 1200, "
        "omega: 0.5}",
        "{law: curve, csv: measured.csv, poisson: 0.49}   # columns strain, stress [Pa]",
        "{law: curve, strain: [0.1, 0.5, 1.0], stress: [1.0e4, 4.0e4, 7.0e4], poisson: 0.4}",
    ),
    material_schema.PresetModel: (
        "{preset: ninjaflex, law: ogden, poisson: 0.495, density: 1200, omega: 0.5}",
        "{preset: dragon_skin_30, scale: 1.5}",
    ),
    schema.RegionModel: ("{material: stiff, where: {box: {x: [0.15, 0.20]}}}",),
    schema.HandleModel: (
        "{where: {face: x-}, fixed: true}",
        "{where: {face: x+}, free: [x, ry]}   # slides along x, turns about y",
        "{where: {face: y-}, slide: [x, z]}   # a plane of symmetry",
    ),
    obstacle_schema.ObstacleModel: (
        "{plane: [0, 0, 1], at: [0, 0, -0.05], friction: 0.5, restitution: 0.3, fixed: true}",
        "{sphere: {radius: 0.04}, at: [0.1, 0, -0.09], gaps: vertices}",
        "{box: {size: [0.1, 0.2, 0.02]}, at: [0.1, 0, -0.09], rotation_deg: [0, 30, 0]}",
        "{capsule: {radius: 0.01, length: 0.1}}",
        "{cylinder: {radius: 0.01, length: 0.1}}",
        "{mesh: {file: part.stl, scale: 0.001}}",
    ),
    obstacle_schema.TriangleMeshModel: (
        "{file: part.stl, scale: 0.001, cell: 0.0005}",
        "{embedded: QUJD, cell: 0.0005}   # as bags carry a surface",
    ),
    obstacle_schema.BodyModel: (
        "{box: {size: [0.02, 0.02, 0.02]}, density: 800, at: [0.1, 0, -0.08], rotation_deg: [0, 0, 30], "
        "friction: 0.5, restitution: 0.8}",
        "{cylinder: {radius: 0.01, length: 0.1}, density: 800, gaps: vertices}",
        "{sphere: {radius: 0.01}, mass: 0.004, at: [0.1, 0, -0.08]}",
        "{capsule: {radius: 0.005, length: 0.04}, density: 800}",
        "{mesh: {file: part.stl, scale: 0.001}, density: 1200}",
    ),
    obstacle_schema.SelfContactModel: ("{friction: 0.5, restitution: 0.1, where: {box: {x: [0.0, 0.1]}}}",),
    obstacle_schema.SensorModel: ("{where: {face: z-}}",),
    Sphere: ("{radius: 0.04}",),
    Box: ("{size: [0.1, 0.2, 0.02]}",),
    Capsule: ("{radius: 0.01, length: 0.1}",),
    Cylinder: ("{radius: 0.01, length: 0.1}",),
    actuator_schema.ActuatorModel: (
        "cable: {points: [[0.0, 0.0, 0.02], [0.2, 0.0, 0.02]]}",
        "chamber: {near: [0.1, 0.0, 0.0]}",
        "growth: {stretch: [0.92, 1.0, 1.0]}",
        "grip: {to: flange, where: {face: x+}}",
    ),
    actuator_schema.AnchorModel: ("{world: [-0.1, 0.0, 0.05]}",),
    actuator_schema.CableModel: (
        "{points: [[0.0, 0.0, 0.02], [0.2, 0.0, 0.02]], command: shortening, stiffness: 2.0e3, range: [0.0, 0.05], "
        "rate: 0.1}",
        "{mesh: left, points: [[0.0, 0.0, 0.01], [0.08, 0.0, 0.01]]}",
        "{points: [{world: [-0.1, 0.0, 0.05]}, [0.0, 0.0, 0.02], [0.2, 0.0, 0.02]]}",
        "{points: [{mesh: left, at: [0.08, 0.0, 0.0]}, {mesh: right, at: [0.08, 0.0, 0.0]}]}",
    ),
    actuator_schema.ChamberModel: (
        "{near: [0.1, 0.0, 0.0], command: pressure, range: [-10.0e3, 40.0e3], rate: 20.0e3}",
        "{cavity: 0, command: volume}",
        "{where: {set: inner_wall}}",
        "{mesh: left, cavity: 0}",
    ),
    actuator_schema.GrowthModel: (
        "{stretch: [0.92, 1.0, 1.0], where: {box: {z: [0.0, 0.01]}}, range: [0.0, 1.0], rate: 0.5}",
    ),
    actuator_schema.GripModel: (
        "{to: flange, body: box, reach: 0.002}",
        "{to: box, where: {face: x+}}   # a suction cup at the tip of a soft arm holds the box",
        "{to: hook, where: {face: x+}}   # an obstacle takes the tip along",
    ),
    actuator_schema.LoadModel: (
        "gravity: [0, 0, -9.81]",
        "point: {at: [0.2, 0.0, 0.0], force: [0, 0, -1]}",
        "surface: {where: {face: z+}, force: [0, 0, -1]}",
        "pressure: {where: {face: z+}, pressure: 2.0e3}",
    ),
    actuator_schema.PressureLoadModel: ("{where: {face: z+}, pressure: 2.0e3}",),
    actuator_schema.PointLoadModel: (
        "{at: [0.2, 0.0, 0.0], force: [0, 0, -1]}",
        "{mesh: left, at: [0.08, 0.0, 0.0], force: [0, 0, -1]}",
    ),
    actuator_schema.PlaceModel: ("{mesh: left, at: [0.08, 0.0, 0.0]}",),
    actuator_schema.SurfaceLoadModel: (
        "{where: {face: z+}, traction: [0, 0, -1.0e3]}",
        "{where: {face: z+}, force: [0, 0, -1]}",
    ),
    material_schema.FibreLayerModel: (
        "{where: {box: {z: [0.005, 0.095]}}, along: [0, 0, 1], angles_deg: [90], stiffness: 2.0e4}   # hoops",
        "{wall: inner, along: [0, 0, 1], angles_deg: [-30, 30], stiffness: 1.0e3, compression: true}   # a braid",
    ),
    arm_schema.ArmModel: (
        "{urdf: ur5e.urdf, flange: tool0, handle: wrist, at: [-0.4, 0, 0], rotation_deg: [0, 0, 90], start: "
        "{elbow_joint: 1.57}, velocity: 2.0, packages: {ur_description: /opt/ros/jazzy/share/ur_description}, limits: "
        "{elbow_joint: {velocity: 1.0}}, acceleration: 10.0, links: [forearm_link], friction: 0.3}",
        "{urdf: arm.urdf, flange: left_tool0, handle: left_wrist, prefix: left_, "
        "compliance: {left_elbow: {stiffness: 8000, damping: 20}}}",
        "{embedded: QUJD, flange: tool0, handle: wrist}   # as bags carry an arm",
    ),
    arm_schema.JointLimitsModel: ("{lower: -1.57, upper: 1.57, velocity: 2.0, acceleration: 10.0, effort: 50.0}",),
    arm_schema.SpringModel: ("{stiffness: 8000, damping: 20}", "{stiffness: 3000}"),
    program.JointPoint: ("{time: 1.0, value: 0.5, velocity: 0.2}",),
    program.Program: (
        "{duration: 1.0, joints: {elbow_joint: [{time: 0.0, value: 1.57}, {time: 1.0, value: 1.2}]}}",
        "{duration: 1.0, handles: {tip: [{time: 0.0}, {time: 1.0, translation: [0, 0, 0.1]}]}, obstacles: {table: "
        "[{time: 1.0, translation: [0, 0, 0.02]}]}, actuators: {tendon: "
        "[{time: 1.0, value: 5.0}]}, loads: {weight: [{time: 0.0, value: 0.0}, {time: 0.5, value: 1.0}]}}",
    ),
    program.Keyframe: ("{time: 1.0, translation: [0, 0, 0.1], rotation_deg: [0, 90, 0]}",),
    program.Point: ("{time: 1.0, value: 5.0}",),
    SolverSettings: (
        "{policy: energy, tolerance: 1.0e-5, steps: 20, max_iterations: 500, threads: 2, "
        "skip: [solve, pressure updates], torsion: section}",
    ),
}
"""Dict from the model of each kind of entry to its example texts; keys that exclude each other have separate texts."""
