from os import PathLike
from typing import Any, Callable, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

__version__: str

class Error(Exception):
    """Something went wrong: what, where, expected, found."""

class Refused(Error):
    """The robot refused what was asked of it."""

class Simulation:
    """A simulated robot on virtual time: it goes on only where it is stepped.

    ``path`` is a file of path points and ``reference`` a table of a motion, ``{"kind": "circle", ...}``: with one of them the
    robot follows its plan as ``omnibase run`` does, to the same bits. Without them it does what it is asked. ``settings``
    replaces keys of the robot's file: ``{"simulation.payload_kg": 100.0}``.

    ``controller`` is a control law in place of the file's: asked in every cycle in which the drives are enabled, it says each
    wheel's torque in N m. Limits, fence and stops hold for it as for any law. What is no number, or raises, stops the robot, and
    what it raised comes out of ``step``. With ``realtime`` a cycle begins no earlier than the clock of this machine says.
    """

    def __init__(
        self,
        robot: str | PathLike[str],
        *,
        path: str | PathLike[str] | None = None,
        reference: dict[str, Any] | None = None,
        settings: dict[str, Any] | None = None,
        controller: Callable[[Moment], Sequence[float]] | None = None,
        realtime: bool = False,
    ) -> None: ...
    def reset(self) -> None:
        """The same robot at its beginning, to the same bits."""
    def step(self, cycles: int = 1) -> None:
        """So many cycles. Refused where the twist at which it was held isn't taken any more, after a stop."""
    def trace(self, cycles: int, signals: Sequence[str]) -> NDArray[np.float64]:
        """So many cycles, and these signals after each of them: a row a cycle. ``*`` stands for any characters."""
    def enable(self) -> None:
        """Enables the drives, after acknowledging a fault, and steps until the robot holds."""
    def drive(self, vx_m_s: float, vy_m_s: float, turn_rad_s: float, frame: str = "body") -> None:
        """Holds a twist from the next cycle on, in the frame ``body`` or ``odom``, until something else is asked."""
    def go_to(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """One cycle, in which the straight way to a pose begins."""
    def stop(self, category: str = "category_2") -> None:
        """One cycle, in which a stop begins: ``category_0``, ``category_1`` or ``category_2`` of IEC 60204-1."""
    def __getitem__(self, signal: str) -> float:
        """A signal of the last cycle, by its name in recordings: ``state.pose_x_m``."""
    @property
    def signals(self) -> list[str]:
        """The names of all signals."""
    @property
    def cycle_s(self) -> float: ...
    @property
    def time_s(self) -> float:
        """When the last cycle was."""
    @property
    def phase(self) -> str:
        """``disabled``, ``enabling``, ``holding``, ``tracking``, ``stopping``, ``quick stopping`` or ``fault``."""
    @property
    def stop_reason(self) -> str | None: ...
    @property
    def is_over(self) -> bool:
        """Whether the plan led the robot to its end, or gave up."""
    @property
    def has_finished(self) -> bool:
        """Whether the plan was followed to its end."""
    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the robot believes to be."""
    @property
    def twist(self) -> tuple[float, float, float]:
        """How fast the robot believes to move."""
    @property
    def true_pose(self) -> tuple[float, float, float]:
        """Where it really is."""
    @property
    def true_twist(self) -> tuple[float, float, float]:
        """How fast it really moves."""
    @property
    def wheel_speeds_rad_s(self) -> list[float]: ...
    @property
    def wheel_torques_nm(self) -> list[float]: ...

class Moment:
    """A cycle as a control law is told it; all in odom."""

    @property
    def time_s(self) -> float: ...
    @property
    def period_s(self) -> float: ...
    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the robot believes to be."""
    @property
    def twist(self) -> tuple[float, float, float]:
        """How fast it believes to move."""
    @property
    def wished_pose(self) -> tuple[float, float, float]:
        """Where it shall be now: of its reference, of a twist or a stop, within the limits."""
    @property
    def wished_twist(self) -> tuple[float, float, float]: ...
    @property
    def wished_acceleration(self) -> tuple[float, float, float]: ...

class Simulations:
    """Many simulated robots of one file, each on a virtual time of its own, stepped on all processors."""

    def __init__(
        self,
        robot: str | PathLike[str],
        count: int,
        *,
        path: str | PathLike[str] | None = None,
        reference: dict[str, Any] | None = None,
        settings: dict[str, Any] | None = None,
        threads: int | None = None,
    ) -> None: ...
    def __len__(self) -> int: ...
    def reset(self, robots: Sequence[int] | None = None) -> None:
        """Begins again with these robots, or all of them."""
    def enable(self, robots: Sequence[int] | None = None) -> None:
        """Enables these robots, or all of them, and steps each until it holds."""
    def drive(self, twists: ArrayLike, frame: str = "body") -> None:
        """Holds each robot at the twist of its row from the next cycle on."""
    def step(self, cycles: int = 1) -> list[bool]:
        """So many cycles of every robot; false for one whose twist wasn't taken, after a stop."""
    def values(self, signals: Sequence[str]) -> NDArray[np.float64]:
        """These signals of every robot's last cycle: a row a robot."""
    @property
    def cycle_s(self) -> float: ...
    @property
    def signals(self) -> list[str]: ...
    @property
    def phases(self) -> list[str]: ...

class Recording:
    """A run read back from its MCAP file; a file that was cut off is read to its last complete cycle."""

    def __init__(self, file: str | PathLike[str]) -> None: ...
    def __len__(self) -> int:
        """How many rows it has."""
    def __getitem__(self, signal: str) -> NDArray[np.float64]:
        """A signal over the run, by its name: ``state.pose_x_m``."""
    def values(self, signals: Sequence[str]) -> NDArray[np.float64]:
        """These signals, a row a cycle. ``*`` stands for any characters."""
    def to_pandas(self, signals: Sequence[str] | None = None) -> pd.DataFrame:
        """A table by the time in s, with these signals, or all of them."""
    @property
    def signals(self) -> list[str]: ...
    @property
    def times_s(self) -> NDArray[np.float64]: ...
    @property
    def events(self) -> list[tuple[float, str]]:
        """What happened: when, and what in words."""
    @property
    def description(self) -> dict[str, str]:
        """What the run is described by: the robot's file and more."""
    @property
    def truncated(self) -> str | None:
        """Where the file breaks off, in words."""

class Kinematics:
    """The wheels of a robot's file. Twists are in the platform's frame."""

    def __init__(self, robot: str | PathLike[str]) -> None: ...
    @property
    def wheels(self) -> list[str]:
        """Their names, in the order of all values of wheels."""
    @property
    def matrix(self) -> NDArray[np.float64]:
        """A row for each wheel: surface speed per vx, vy (no unit) and turn (m)."""
    def wheel_speeds_rad_s(self, twist: tuple[float, float, float]) -> list[float]: ...
    def twist(self, wheel_speeds_rad_s: Sequence[float]) -> tuple[tuple[float, float, float], float]:
        """The twist that wheel speeds show, and what no twist explains of them, m/s."""
    def wheel_torques_nm(self, wrench: tuple[float, float, float]) -> list[float]:
        """The smallest torques that make a wrench: N ahead, N to the left, N m."""
    def wrench(self, wheel_torques_nm: Sequence[float]) -> tuple[float, float, float]: ...

class Odometry:
    """Odometry of wheels that turn by angles."""

    def __init__(self, kinematics: Kinematics) -> None: ...
    def advance(self, increments_rad: Sequence[float], period_s: float) -> tuple[float, float, float]:
        """The pose after the wheels turned by these angles in this time."""
    @property
    def pose(self) -> tuple[float, float, float]: ...
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of x, y and heading: m² and rad²."""
    def set_pose(self, pose: tuple[float, float, float]) -> None: ...

def trajectory(points: ArrayLike, period_s: float, interpolation: str = "spline") -> NDArray[np.float64]:
    """The motion along points (t, x, y, heading), a row every ``period_s``: t since its beginning, then pose, twist and
    acceleration in odom. ``interpolation`` is ``cubic``, ``quintic``, ``spline`` or ``b_spline``."""

class Robot:
    """A seat at a running robot: the one of this machine that was started last, or the one at an address. It must be heard
    from: a program that says nothing for a second is gone, and what it drove stops."""

    def __init__(self, address: str | None = None, token: str | None = None) -> None: ...
    def drive(self, vx_m_s: float, vy_m_s: float, turn_rad_s: float, frame: str = "body") -> None:
        """Holds a twist as it is meant now, for ``safety.command_age_ms``. Refused once something else stopped the robot."""
    def let_go(self) -> None:
        """The robot comes to rest, and holds."""
    def enable_stick(self) -> None:
        """The stick that was lost may drive again. A person decides that, after looking at the robot."""
    def call(self, what: str, **keys: Any) -> Any:
        """Asks for something, by its name and keys in the robot's description, and waits for its answer."""
    def status(self, timeout_s: float = 1.0) -> dict[str, Any]:
        """What the robot does, as it says next; it says so thirty times a second."""
    @property
    def drives(self) -> bool:
        """Whether the robot follows this program, as it said last."""

class Signals:
    """Signals of a running robot, cycle by cycle."""

    def __init__(
        self,
        signals: Sequence[str] | None = None,
        every_ms: float | None = None,
        *,
        address: str | None = None,
        token: str | None = None,
    ) -> None: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def cycle_ms(self) -> float: ...
    @property
    def missing(self) -> int:
        """Cycles that never came, because this program or its line was too slow for them."""
    def rows(self, timeout_s: float = 1.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The rows that came: their instants in s on the robot's clock, and their values. None where none comes in that time."""

def scan(target: str, *, dictionary: bool = False, force: bool = False) -> list[dict[str, Any]]:
    """The SubDevices at a network interface, at ``@robot``, or of ``sim:<segment.toml>``, as ``omnibase scan --json`` tells
    them; where wished with their dictionaries. ``force`` takes the segment from another MainDevice, here and below."""

def sdo_read(
    target: str, position: int, object: str, *, type: str | None = None, force: bool = False
) -> int | float | bool | str | bytes:
    """An object of the SubDevice at a position: ``"6041:00"``. Its type is what the SubDevice tells, or ``u8`` to ``i64``,
    ``f32``, ``f64``, ``bool``, ``string``, ``hex``."""

def sdo_write(
    target: str,
    position: int,
    object: str,
    value: int | float | bool | str | bytes,
    *,
    type: str | None = None,
    force: bool = False,
) -> None:
    """Writes an object; bytes go as they are."""

def exchange(
    target: str, *, cycles: int = 10_000, cycle_us: float = 1000.0, dc: bool = False, force: bool = False
) -> dict[str, Any]:
    """To OP, so many cycles of process data with zeros, and back to INIT: what ``omnibase exchange --json`` tells. No drive is
    enabled, but the segment goes to OP: wheels off the ground."""
