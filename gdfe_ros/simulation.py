# SPDX-License-Identifier: Apache-2.0
"""A scene that can be stepped: commands in, results out. The only public interface to the solver."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.actuators.load import LOAD_FACTOR
from gdfe_ros.arms.carriers import Carriers, Motions
from gdfe_ros.command import Command, Orders, check_positions, require_countable, require_snapshot, require_times
from gdfe_ros.constraints import Pose
from gdfe_ros.coupling.joint_coupling import JointCoupling
from gdfe_ros.differentiation.differentiator import make_differentiator
from gdfe_ros.errors import CommandError, OverlapError
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.building.soft_bodies import parts_of
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.solvable import refuse_unsolvable
from gdfe_ros.simulation_parts.grip_reach import find_far_grips
from gdfe_ros.simulation_parts.rigid_places import carry_soft, move_along, put_rigid, require_free
from gdfe_ros.simulation_parts.scene_readings import SceneReadings
from gdfe_ros.simulation_parts.soft_places import put_soft, require_soft_free, vertices_of_soft
from gdfe_ros.simulation_parts.state_tree import complete
from gdfe_ros.simulation_parts.steppers import make_stepper, scene_body, step_result, usual_steps, working_origin
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.outcome import Deadline
from gdfe_ros.solver.settings import SolverSettings
from gdfe_ros.solver.solution import PathResult
from gdfe_ros.solver.state import Snapshot, State
from gdfe_ros.solver.terms.term import Term

if TYPE_CHECKING:
    from gdfe_ros.differentiation.derivatives import Sensitivities

WARM_UP = 1e-3
"""Displacement of the handles, divided by the body's size, in the step that compiles every kernel."""


class Simulation(SceneReadings):
    """A scene and its state.

    Args:
        scene: the scene to simulate.
        settings: solver settings that replace the scene's.
        terms: functions that make further terms of the potential (`docs/terms.md`); each is called with the body.

    Attributes:
        stepper: advances states; its equilibrium solver contains matrices, terms and contacts.
        state: all data that change during a run; immutable. `snapshot` and `restore` save and set it.
        origin: origin (3,) [m] to which the positions in `state` are relative.

    Raises:
        SceneError: the scene cannot be solved, e.g. because it has forces under the policy ``relative``.

    Example:
        >>> from gdfe_ros import Command, Pose, Simulation, load_scene
        >>> simulation = Simulation(load_scene("bend5"))
        >>> result = simulation.step(Command(handles={"tip": Pose(translation=(0.0, 0.0, 0.1))}))
        >>> result.converged
        True
    """

    def __init__(
        self, scene: Scene, *, settings: SolverSettings | None = None, terms: Sequence[Callable[[Body], Term]] = ()
    ) -> None:
        self.scene = scene
        self.settings = settings or scene.solver
        refuse_unsolvable(scene, self.settings)
        self._orders = Orders(scene, self.settings)
        self._carriers = Carriers(scene.arms)
        # It stays where it is while soft bodies join and leave.
        self.origin = working_origin(next(iter(parts_of(scene.mesh).values())).place())
        body = scene_body(scene, self.origin, self.settings.torsion)
        self.stepper = make_stepper(scene, self.settings, body, terms)
        self._coupling = JointCoupling(
            scene.arms,
            self.stepper,
            dynamics=scene.dynamics,
            loads=scene.loads,
            tolerance=self.settings.tolerance,
            origin=self.origin,
        )
        self._differentiator = make_differentiator(scene, self.stepper, self._orders)
        self.reset()

    def reset(self) -> None:
        """Restore the initial state at time 0."""
        self.state = self.stepper.at_rest()
        self._joints, self._cuts = self._carriers.at_rest(), {}
        self._links = self._coupling.at_rest()
        self.time = 0.0
        self.targets = {handle.name: Pose() for handle in self.scene.handles}
        self.commands = dict(self.state.commands)
        self.commands.update({load.name: LOAD_FACTOR for load in self.scene.loads})
        self._neutral = dict(self.commands)
        self._differentiator.forget()
        self.result: StepResult | None = None

    def reset_shape(self) -> None:
        """Restore the rest shape and the initial commands, but not the time; rigid bodies stay, with zero velocity.

        Raises:
            OverlapError: a rigid body overlaps the body's rest shape; the state is unchanged.
        """
        before, places = self.snapshot(), {name: self.handle_pose(name) for name in self._rigid}
        self.reset()
        self.time = before.time
        try:
            self.state = put_rigid(self.stepper, self.state, places) if places else self.state
        except OverlapError:
            self.restore(before)
            raise

    def reset_arms(self) -> None:
        """Put all arms back to their initial joint positions at once.

        Soft bodies that the arms hold move along and keep their shapes. Time, loads and actuators stay, rigid bodies
        keep their places, and all velocities are the initial ones.

        Raises:
            CommandError: the scene has no arms, a grip holds something, or another handle holds what an arm holds; the
                state is unchanged.
            OverlapError: a rigid body would be inside of the body or a link; the state is unchanged.
        """
        if not self._carriers:
            raise CommandError(f"scene {self.scene.name!r} has no arms; ~/reset goes back to rest as a whole")
        if holding := self.stepper.actuation.holding(self.state):
            raise CommandError(f"grips hold something: {', '.join(holding)}; remedy: let go first, command 0")
        motions = self._carriers.at_rest()
        poses = self._carriers.advance(motions, {}, 0.0, {}).poses
        moved, positions = move_along(self.stepper.body, self.stepper.equilibrium.handles, self.state, poses)
        found = self.stepper.place(moved, positions)
        require_free(self.stepper.body, found, self._rigid)
        self.state, self._joints, self._cuts = self.stepper.carry_energies(found, self.state), motions, {}
        self._links = self._coupling.at_rest()
        self.targets = {**self.targets, **poses}

    def rest_command(self) -> Command:
        """Return the initial command: handles at their rest poses, neutral actuators, loads with initial factors."""
        return Command(
            handles=dict.fromkeys(self._movable, Pose()),
            actuators={name: self._neutral[name] for name in self.actuator_names},
            loads={load.name: self._neutral[load.name] for load in self.scene.loads},
            joints=self._carriers.parts(self._carriers.at_rest(), "goals"),
        )

    def snapshot(self) -> Snapshot:
        """Return all data that change during a run, as an immutable value for `restore`."""
        given = {"targets": self.targets, "commands": self.commands, "scene": self._orders.text}
        return Snapshot(state=self.state, time=self.time, joints=self._joints, links=self._links, **given)

    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot of a simulation of the same scene; raise `CommandError` if the scene differs."""
        require_snapshot(snapshot)
        state = complete(snapshot.state, self.stepper)
        self._orders.require_own(snapshot)
        self.state, self.time, self.result = state, snapshot.time, None
        self._joints, self._cuts = self._carriers.restore(snapshot.joints), {}
        self._links = self._coupling.restore(snapshot.links)
        self.targets, self.commands = dict(snapshot.targets), dict(snapshot.commands)

    def warm_up(self) -> None:
        """Compile every kernel or load it from the cache, so that the first step is not slower; then reset."""
        shift = Pose((0.0, 0.0, WARM_UP * self.mesh.size))
        self.step(Command(handles=dict.fromkeys(self._movable, shift)))
        self.fields()
        self.reset()

    def step(
        self,
        command: Command | None = None,
        *,
        dt: float | None = None,
        deadline: float | None = None,
        cut_after: int | None = None,
        interrupted: Callable[[], bool] | None = None,
    ) -> StepResult:
        """Apply a command for ``dt`` [s], and solve for its equilibrium or, with dynamics, for the motion in that time.

        Args:
            command: new targets; None keeps the last targets.
            dt: simulation time of the step [s], at most 1e9 s and, with dynamics, 100000 internal steps. None means 0 s
                without dynamics, and one internal step with dynamics.
            deadline: wall time [s] after which the best state so far is returned; later steps continue from it.
            cut_after: number of checks of the deadline after which the solve ends. It repeats a recorded step
                (``StepResult.cut_after``).
            interrupted: function that is called repeatedly. If it returns True, the solve ends as at a deadline, and
                the message states the reason.

        Raises:
            CommandError: a name, a value, a time or a pose is not allowed; the state is unchanged.
        """
        started, moves = time.perf_counter(), self.scene.dynamics
        if dt is None:
            dt = moves.step if moves else 0.0
        dt = require_times(dt=dt, deadline=deadline, cut_after=cut_after)
        targets, places = self._orders.targets(command, self.targets), self._orders.places(command)
        moved = self._carriers.advance(self._joints, self._orders.positions(command), dt, targets)
        targets |= moved.poses
        commands = self._orders.values(command, self.commands)
        limited = self._orders.within_rates(commands, self.state.commands, dt)
        self._require_grips(limited, places)
        rests = not places and self._rests(moved.motions, targets, limited)
        if moves and not rests:
            require_countable(dt=dt, step=moves.step)
        self.state = self.put(places) if places else self.state
        self.targets, self.commands = targets, commands
        before, self._joints, self._cuts = self._joints, moved.motions, moved.cuts
        limit = Deadline.of(started, deadline, cut_after, interrupted)
        outcome = None
        rests = rests or (bool(places) and self._rests(self._joints, targets, limited))
        if not rests and (dt or not moves):
            outcome = self._advance(before, limited, dt, limit)
            self.state = outcome.state
            if outcome.simulated is not None and outcome.simulated < dt:
                self._joints = self._carriers.part_way(before, self._joints, outcome.simulated / dt)
        self.time += dt if outcome is None or outcome.simulated is None else outcome.simulated
        given = {"time": self.time, "origin": self.origin, "started": started, "limit": limit}
        self.result = step_result(self.stepper, self.state, outcome, **given)
        return self.result

    def put(self, places: Mapping[str, Pose]) -> State:
        """Return the present state with free bodies, rigid or soft, at poses relative to their rest poses, not moving.

        The simulation itself stays as it is; a `Command` with ``bodies`` teleports them.

        Raises:
            OverlapError: a body is inside of an obstacle or of another body there.
        """
        state, soft = self.state, {name: pose for name, pose in places.items() if name in self.scene.soft_bodies}
        if soft:
            vertices, moved = vertices_of_soft(self.scene, soft), state.positions.copy()
            moved[vertices] = put_soft(self.scene, moved + self.origin, soft)[vertices] - self.origin
            state = carry_soft(self.stepper, state, vertices, moved)
        if rigid := {name: pose for name, pose in places.items() if name not in soft}:
            state = put_rigid(self.stepper, state, rigid)
        if soft:
            require_soft_free(self.scene, state.poses, state.positions + self.origin, soft)
        return state

    def _require_grips(self, commands: Mapping[str, float], places: Collection[str]) -> None:
        """Raise CommandError if a grip would take hold from too far away, or if a held body is put elsewhere."""
        actuation = self.stepper.actuation
        if texts := find_far_grips(actuation, self.state, commands):
            raise CommandError("; ".join(texts.values()))
        holding = actuation.holding(self.state)
        soft = {name: vertices_of_soft(self.scene, [name]) for name in places if name in self.scene.soft_bodies}
        for grip in (each.actuator for each in actuation.grips if each.name in holding):
            held = {name for name, vertices in soft.items() if np.isin(grip.vertices, vertices).any()}
            if moved := sorted(({grip.held, grip.holder} & set(places)) | held):
                raise CommandError(f"body {moved[0]!r} is held by grip {grip.name!r}; remedy: let go first, command 0")

    def _rests(self, motions: Motions, targets: Mapping[str, Pose], commands: Mapping[str, float]) -> bool:
        """Return whether body and yielding joints are at rest, and would stay at rest at these commands."""
        return self._coupling.rests(motions, self._links) and self.stepper.rests(self.state, targets, commands)

    def _advance(self, before: Motions, commands: Mapping[str, float], dt: float, limit: Deadline | None) -> PathResult:
        """Make a step to the targets; ``before`` are the motions of the arms' motors before the step."""
        given = {"targets": self.targets, "commands": commands, "duration": dt, "deadline": limit}
        if not self._coupling:
            return self._differentiator.step(self.state, **given)
        outcome = self._coupling.step(self.state, links=self._links, motors=(before, self._joints), **given)
        self._links = outcome.links
        self.targets = {**self.targets, **outcome.poses}
        return outcome.result

    def set_positions(self, positions: ArrayLike) -> None:
        """Set the vertex positions from which the next step starts, e.g. those of another simulation.

        Commands do not change. Handles keep their commanded poses. Sliding handles keep the offset of their first
        vertex along free axes. Pressures, captured shapes and the last motion are reset. With dynamics, steps continue
        with the initial velocities. If elements are inverted, the next equilibrium is compared with the equilibrium
        from the rest shape, and the one with the lower energy is kept. `StepResult.restarts` and the message report it.

        Args:
            positions: (n, 3) finite [m].

        Raises:
            CommandError: the shape differs, a value is not finite, or a freely rotating handle is flattened so that its
                rotation is undetermined; the state is unchanged.
        """
        given = check_positions(positions, self.mesh.vertices.shape)
        placed = np.concatenate([given - self.origin, self.state.positions[self.mesh.n_vertices :]])
        self.state = self.stepper.place(self.state, placed)

    def observe_energy(self, observer: Callable[[float, float, bool], None]) -> None:
        """Register an observer that is called in every iteration of the policy ``energy``, never of ``relative``.

        The observer's arguments are the energy [J], the magnitude of the energy's terms [J], and whether a minimisation
        starts. Within a minimisation the energy must not rise. New pressures or scales start another minimisation.
        """
        self.stepper.equilibrium.observe(observer)

    def play(self, steps: int | None = None) -> Iterator[StepResult]:
        """Play the scene's program from the present time on, and yield the result of each step.

        Args:
            steps: number of equal load steps of the whole program; None: the number in the settings, or else
                `usual_steps`. Load steps that end before the present time are left out.

        Raises:
            CommandError: the scene has no program, the program has ended, or ``steps`` is not 1 or more.
        """
        program = self.scene.program
        if program is None:
            raise CommandError(f"scene {self.scene.name!r} has no program to play; add the key 'program'")
        if steps is not None and not (isinstance(steps, Integral) and steps >= 1):
            raise CommandError(f"steps is {steps!r}; allowed: whole numbers from 1 on")
        steps = steps or self.settings.steps or usual_steps(self.scene, self.policy)
        left = [moment for moment in program.moments(steps) if moment > self.time]
        if not left:
            raise CommandError(f"the program has ended at {program.duration:g} s; remedy: reset() before play()")
        for moment in left:
            command = Command(
                program.handle_poses(moment),
                program.actuator_values(moment),
                program.load_factors(moment),
                joints=program.joint_positions(moment),
            )
            yield self.step(command, dt=moment - self.time)

    def sensitivities(
        self,
        outputs: Sequence[str] | None = None,
        parameters: Sequence[str] | None = None,
        *,
        interrupted: Callable[[], bool] | None = None,
    ) -> Sensitivities:
        """Return exact derivatives d(output)/d(parameter) at the present state, which is not modified.

        At an equilibrium they satisfy K dx = -dF (docs/sensitivities.md). Points in contact are assumed to stay in
        contact, and sticking points to stick.

        Args:
            outputs: ``probes.<name>``, ``reactions.<handle or obstacle>``, ``positions``; None: all probes.
            parameters: names from `parameter_names`; None: all actuators.
            interrupted: function that is called repeatedly. If it returns True, an error is raised.

        Raises:
            CommandError: there is no such output or parameter.
            GdfeError: there is no derivative, e.g. at a saddle or after a step that has not converged; or the
                computation was interrupted.
        """
        given = {"solved": self.result is not None or self.commands == self.state.commands, "interrupted": interrupted}
        return self._differentiator.sensitivities(self.state, outputs, parameters, **given)

    def follow(self, parameters: Sequence[str] | None = None) -> None:
        """Update derivatives in all further steps; `sensitivities` then returns those of the motion after this call.

        Effects of a parameter before this call are not included: a modulus counts as changed from the present time, a
        command from the next step. After the state was replaced, e.g. by `restore` or `reset`, and a step was made,
        `sensitivities` raises an error until this method is called again. Without dynamics this method has no effect,
        because the derivatives of an equilibrium do not depend on earlier steps.

        Args:
            parameters: names from `parameter_names`; None: all actuators.

        Raises:
            CommandError: there is no such parameter, or none is named.
        """
        self._differentiator.follow(self.state, parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters of `sensitivities`, e.g. ``materials.silicone.young`` or ``handles.tip.x``."""
        return self._differentiator.derivatives.parameters.names

    def jacobian(
        self,
        probes: Sequence[str] | None = None,
        actuators: Sequence[str] | None = None,
        *,
        interrupted: Callable[[], bool] | None = None,
    ) -> NDArray[np.float64]:
        """Return d(probe position)/d(command) at the present state, (probes, 3, actuators).

        It is the derivative of `sensitivities`: at an equilibrium, a cable that is just slack counts as taut. For a
        motion it is the derivative of the state at the end of the last step with respect to the final command of that
        step. The policy ``relative`` has no forces; there it is a difference of two steps from the present state.

        Args:
            probes: names; None: all, in the scene's order.
            actuators: names; None: all, in the scene's order.
            interrupted: function that is called repeatedly. If it returns True, an error is raised.

        Raises:
            GdfeError: there is no such probe or actuator, there is no derivative, or the computation was interrupted.
        """
        return self._differentiator.jacobian(self.state, probes, actuators, interrupted=interrupted)
