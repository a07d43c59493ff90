"""Driver of the laser, the twin of ``rtl/actuators/laser_control.sv``.

VR-SCAN IV-B and (10): the power follows the peak of the line before, and the power that a pulse
really had is stored with its line.
"""

from typing import Any

from vrscan.clocked import laser_interlock, power_adaptation
from vrscan.clocked.guard_watch import GuardWatch
from vrscan.clocked.laser_heartbeat import LaserHeartbeat
from vrscan.clocked.sigma_delta import SigmaDelta
from vrscan.data import pkg
from vrscan.registers.settings import LaserSettings


class LaserControl:
    """Clock-accurate control. A new one is in the state after a reset.

    ``line`` and the interlock's ``gate`` depend on inputs of their own clock, so they are functions
    of them; all other outputs are registers.

    Args:
        settings: The registers. ``settings`` may be replaced between two steps.
        ceilings: Parameters of the interlock.
        heartbeat_bits: Period of the heartbeat, ``HeartbeatBits``.
        guard_beat_clks: Clocks without the guard's beat that are its death, ``GuardBeatClks``.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        adaptation: Twin of the module that says which power is wanted.
        interlock: Twin of the module that says which light there is. The RTL's two never differ.
        guard: Twin of the module that watches the guard.
        power_pin, startup_pin: Sigma-delta outputs of the two channels' levels.
    """

    def __init__(
        self,
        settings: LaserSettings,
        ceilings: laser_interlock.Ceilings | None = None,
        heartbeat_bits: int = 5,
        count_width: int = 16,
        guard_beat_clks: int = 64,
    ) -> None:
        self.adaptation = power_adaptation.PowerAdaptation(settings)
        self.interlock = laser_interlock.LaserInterlock(settings, ceilings, count_width)
        self.guard = GuardWatch(guard_beat_clks, count_width)
        self._heart = LaserHeartbeat(heartbeat_bits)
        self.power_pin = SigmaDelta(pkg.POWER_WIDTH)
        self.startup_pin = SigmaDelta(pkg.POWER_WIDTH)
        self._settings = settings
        self._whole = False
        self._line = (0, False)

    @property
    def settings(self) -> LaserSettings:
        """Return the registers."""
        return self._settings

    @settings.setter
    def settings(self, settings: LaserSettings) -> None:
        self._settings = self.adaptation.settings = self.interlock.settings = settings

    @property
    def heartbeat(self) -> bool:
        """Return the core's sign of life for the guard."""
        return self._heart.heartbeat

    def line(self, *, pulse: bool, centre: bool, phase: int) -> tuple[int, bool]:
        """Return the line's power and whether it is inward, in a clock with these inputs."""
        if not centre:
            return self._line
        return self.interlock.power if self.interlock.gate(pulse) else 0, _inward(phase)

    def step(
        self,
        *,
        pulse: bool,
        line_start: bool,
        centre: bool,
        state: int,
        index_alive: bool,
        scanning: bool,
        startup_ok: bool,
        phase: int,
        alive: bool,
        guard_ok: bool,
        guard_beat: bool,
        guard_fault: int,
        **point: Any,
    ) -> None:
        """Advance by one clock; the arguments are the input ports, ``point`` the adaptation's."""
        interlock, adaptation = self.interlock, self.adaptation
        lit = interlock.gate(pulse)
        power, inward = self.line(pulse=pulse, centre=centre, phase=phase)
        # A cut that comes behind the centre still takes the line its power.
        self._line = (0 if self._whole and pulse and not lit and not centre else power, inward)
        self._whole = pulse and (lit if centre else self._whole)
        self.power_pin.step(interlock.power)
        self.startup_pin.step(interlock.startup)

        wanted, armed = adaptation.power, interlock.armed
        interlock.step(
            pulse=pulse,
            power=wanted,
            line_start=line_start,
            state=state,
            index_alive=index_alive,
            scanning=scanning,
            startup_ok=startup_ok,
            phase=phase,
            alive=alive,
            guard_ok=self.guard.ok,
        )
        self.guard.step(guard_ok=guard_ok, guard_beat=guard_beat, guard_fault=guard_fault)
        self._heart.step(enable=bool(self.settings.enable))
        adaptation.step(pulse=pulse, armed=armed, inward=_inward(phase), **point)


def _inward(phase: int) -> bool:
    """Return whether the mirror is in the first half of its turn."""
    return phase < 1 << (laser_interlock.PHASE_WIDTH - 1)
