"""Control of the lens by the scene's distance, the twin of ``rtl/actuators/focus_control.sv``.

VR-SCAN IV-E: a piezo motor and a magnetic position sensor, here on one I2C bus.
"""

from vrscan.clocked import focus_filter, focus_target
from vrscan.clocked.focus_filter import FocusFilter
from vrscan.clocked.focus_motor import FocusMotor
from vrscan.clocked.focus_target import FocusTarget
from vrscan.clocked.i2c_master import I2cMaster
from vrscan.registers.settings import FocusSettings

DISTANCE_LATENCY = focus_filter.LATENCY  # clocks from valid to the distance
# Clocks from valid to the target; points that come sooner are ignored.
TARGET_LATENCY = DISTANCE_LATENCY + focus_target.LATENCY


class FocusControl:
    """Clock-accurate control with its bus master. A new one is in the state after a reset.

    Args:
        settings: The configuration ports; ``configure`` changes them between two steps.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        filter, lens, motor, master: The twins of the parts; ``lens`` chooses its target. Their
            outputs are the control's.
    """

    def __init__(self, settings: FocusSettings, count_width: int = 16) -> None:
        self.filter = FocusFilter(settings)
        self.lens = FocusTarget(settings)
        self.motor = FocusMotor(settings, count_width)
        self.master = I2cMaster(count_width)
        self.configure(settings)

    def configure(self, settings: FocusSettings) -> None:
        """Change the configuration."""
        self._settings = settings
        self.filter.settings = self.lens.settings = self.motor.settings = settings

    def step(
        self,
        *,
        valid: bool,
        measured: bool,
        flags: int,
        test: bool,
        z: int,
        scl: bool,
        sda: bool,
        table_write: bool = False,
        table_index: int = 0,
        table_position: int = 0,
    ) -> None:
        """Advance by one clock with these inputs and levels of the pins."""
        settings, lens, motor, master = self._settings, self.lens, self.motor, self.master
        # Each part sees the outputs of the others from the previous clock.
        busy = lens.busy
        reply_valid, reply_status, reply_data = master.valid, master.status, master.data
        master.step(
            valid=motor.command_valid,
            read=motor.command_read,
            address=settings.address,
            register=motor.command_register,
            bytes=1,
            data=motor.command_data,
            scl=scl,
            sda=sda,
            quarter=settings.quarter_clks,
            timeout=settings.stretch_clks,
        )
        motor.step(
            target=lens.target,
            known=lens.known,
            reply_valid=reply_valid,
            reply_status=reply_status,
            reply_data=reply_data,
        )
        lens.step(
            valid=self.filter.valid,
            distance=self.filter.distance,
            lapse=self.filter.lapse,
            table_write=table_write,
            table_index=table_index,
            table_position=table_position,
        )
        self.filter.step(valid=valid, measured=measured, flags=flags, test=test, z=z, busy=busy)
