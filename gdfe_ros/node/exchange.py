# SPDX-License-Identifier: Apache-2.0
"""Changes of a configured node's scene: the new simulation is built in a thread, then it takes the old one's place."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.session import SimulationSession
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

MOST_WAITING = 20
"""Largest number of changes that wait for those before them; further ones are refused."""


@dataclass(eq=False)
class _Change:
    """A requested change.

    Attributes:
        make: function that returns the new scene from the present one.
        anew: whether the new simulation starts at rest at time 0; otherwise it continues the motion.
        outcome: of the change: the new scene.
        built: the new simulation, or the exception that prevented it.
        before: the scene from which it was built.
    """

    make: Callable[[Scene], Scene]
    anew: bool
    outcome: Future[Scene] = field(default_factory=Future)
    built: Simulation | Exception | None = None
    before: Scene | None = None


class SceneExchange:
    """Carries out changes of the scene one after another; the steps go on while a simulation is built.

    Args:
        node: node whose executor exchanges the simulations.
        session: function that returns the running session, or None.
        replace: function that replaces the session's simulation. Its further arguments are the scene from which the
            simulation was made, and whether to start anew. It returns whether this is still the session's scene.
    """

    def __init__(
        self,
        node: ManagedNode,
        session: Callable[[], SimulationSession | None],
        replace: Callable[[Simulation, Scene, bool], bool],
    ) -> None:
        self._node, self._session, self._replace = node, session, replace
        self._waiting: deque[_Change] = deque()
        self._busy: _Change | None = None

    def request(self, make: Callable[[Scene], Scene], *, anew: bool = False) -> Future[Scene]:
        """Change the scene by ``make``, and return a ``Future`` of the new scene. Called in the executor's thread."""
        change = _Change(make, anew)
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append(change)
            self._begin()
        else:
            change.outcome.set_exception(
                GdfeError(f"{MOST_WAITING} changes of the scene wait already; ask again later")
            )
        return change.outcome

    def _begin(self) -> None:
        if self._busy is not None or not self._waiting:
            return
        change, session = self._waiting.popleft(), self._session()
        if session is None:
            change.outcome.set_exception(GdfeError("the node was cleaned up before the scene was changed"))
            self._begin()
            return
        self._busy, change.before = change, session.scene

        def build() -> None:
            try:
                change.built = Simulation(change.make(change.before))
                change.built.warm_up()
            except Exception as error:
                change.built = error

        self._node.in_background(build, lambda: self._finish(change), name="exchange")

    def _finish(self, change: _Change) -> None:
        self._busy = None
        try:
            found = self._exchange(change)
        except Exception as error:
            change.outcome.set_exception(error)
        else:
            if found is None:
                self._waiting.appendleft(change)  # moduli, or the whole scene, have changed: build it again
            else:
                change.outcome.set_result(found)
        self._begin()

    def _exchange(self, change: _Change) -> Scene | None:
        """Carry out a change and return the new scene; None if the present scene is another one meanwhile."""
        if isinstance(change.built, Exception):
            raise change.built
        session = self._session()
        if session is None:
            raise GdfeError("the node was cleaned up before the scene was changed")
        session.bags.require_none()
        if session.walk is not None and session.walk.going:
            raise GdfeError(f"a request has made {session.walk}; wait for its end, or end it with ~/pause true")
        return change.built.scene if self._replace(change.built, change.before, change.anew) else None
