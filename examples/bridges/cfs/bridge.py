"""A bridge between `rso-lidar serve` and cFS: space packets over UDP. README.md states each packet.

rso-lidar serve ../../flight_software/tumbling_stage.toml &
python bridge.py --listen 127.0.0.1:1235 --send 127.0.0.1:1234
"""

import argparse
import ipaddress
import math
import socket
import sys
from collections import Counter

import packets as sp

import rso_lidar as rl


class Bridge:
    """Carries out telecommands on a simulation, and answers each with packets; the last is HOUSEKEEPING."""

    def __init__(self, simulation, warn=lambda line: print(line, file=sys.stderr)):
        self.simulation, self.warn, self.telemetry = simulation, warn, sp.Telemetry()
        self.command, self.mode, self.is_over = rl.Command(), 0, False
        self.accepted, self.refused, self.lost, self.last = 0, Counter(), 0, 0
        self.expected, self.latest, self.resend = None, -1, []

    @property
    def time_ns(self):
        return round(self.simulation.time_s * 1e9)

    def answer(self, datagram):
        """Carry out a telecommand, and return the packets to be sent."""
        made = []
        try:
            function, values, count, lost = sp.read_command(datagram, self.expected)
            self.expected = (count + 1) % 16384
            if lost:
                self.lost += lost
                self.warn(f"telecommands: {lost} lost before number {count}")
            made = self.carry_out(function, *values)
            self.accepted, self.last = self.accepted + 1, function
        except sp.RefusedError as error:
            self.refused[error.reason] += 1
            self.warn(f"telecommand refused: {error}")
        except rl.RsoLidarError as error:
            self.refused["failed"] += 1
            self.warn(f"telecommand refused: {error}")
        return [*made, self.pack_housekeeping()]

    def pack_housekeeping(self):
        state = self.accepted, self.refused, self.lost, self.last, self.mode
        return self.telemetry.pack_housekeeping(*state, self.time_ns)

    def carry_out(self, function, *values):
        """Carry out a telecommand, and return the packets of its answer."""
        if function == sp.STEP:
            return self.step_to_flash(*values)
        if function == sp.STEP_UNTIL:
            return self.step_until(*values)
        if function == sp.POINT:
            if any(math.isinf(angle) for angle in values):
                raise sp.RefusedError("failed", "an angle is infinite; NaN leaves an axis to the scenario")
            pan, tilt = (None if math.isnan(angle) else angle for angle in values)  # NaN: as the scenario has it
            self.command = rl.Command(pan_rad=pan, tilt_rad=tilt, inputs=self.command.inputs)
        elif function == sp.INPUTS:
            if not all(math.isfinite(value) for value in values[1:]):
                raise sp.RefusedError("failed", f"inputs of '{values[0]}' are not finite")
            inputs = {**(self.command.inputs or {}), values[0]: values[1:]}
            self.command = rl.Command(pan_rad=self.command.pan_rad, tilt_rad=self.command.tilt_rad, inputs=inputs)
        elif function == sp.MODE:
            if values[0] > 1:
                raise sp.RefusedError("function", f"mode {values[0]} is not 0 (lock-step) or 1 (continuous)")
            self.mode = values[0]
        elif function == sp.RESET_COUNTERS:
            self.accepted, self.refused, self.lost = 0, Counter(), 0
        elif function == sp.SHUT_DOWN:
            self.is_over = True
            self.simulation.shut_down()
        return []

    def step_to_flash(self, number):
        """Go to a flash. One that has been made is sent again: a repeated telecommand does not step twice."""
        if number == self.latest:
            return self.resend
        if number != self.latest + 1:
            raise sp.RefusedError("failed", f"flash {number} is not the next, which is {self.latest + 1}")
        return self.step()

    def step_until(self, time_ns):
        """Go on to a time. At that time already, the last packets are sent again."""
        if time_ns == self.time_ns:
            return self.resend
        if time_ns < self.time_ns:
            raise sp.RefusedError("failed", f"{time_ns} ns is before the present, {self.time_ns} ns")
        return self.step(dt_s=(time_ns - self.time_ns) / 1e9)

    def step(self, **length):
        """Step under the command in force, and return the packets of samples and reading."""
        try:
            flash = self.simulation.step(self.command, **length)
        except rl.ScenarioError:
            self.command = rl.Command()  # else an impossible one is refused at every step
            raise
        made = self.telemetry.pack_samples(self.simulation.samples, self.time_ns)
        if flash is not None:
            self.latest = flash.index
            made += self.telemetry.pack_reading(flash, self.simulation.is_over, self.time_ns)
        self.resend = made
        return made

    def run(self, link, peer):
        """Answer telecommands from a socket until one shuts the server down; in mode 1 step by itself, too."""
        while not self.is_over:
            is_stepping = self.mode == 1 and not self.simulation.is_over
            link.settimeout(0.0 if is_stepping else 0.5)
            try:
                outgoing = self.answer(link.recv(65536))
            except (BlockingIOError, TimeoutError):
                outgoing = self.step() if is_stepping else []
            except ConnectionRefusedError:
                continue  # no socket is bound at the peer yet: the system reports this at a later call
            for packet in outgoing:
                link.sendto(packet, peer)


def read_address(text):
    """Return host and port of an address such as 127.0.0.1:1234."""
    host, _, port = text.rpartition(":")
    if not port.isdecimal() or not 0 < int(port) < 65536:
        raise argparse.ArgumentTypeError(f"'{text}' has no port; write an address such as 127.0.0.1:1234")
    try:
        return str(ipaddress.IPv4Address(host)), int(port)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{host}' is no IPv4 address; write one such as 127.0.0.1:1234") from None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--server", default="tcp://127.0.0.1:5571", help="address of rso-lidar serve")
    listen = "address of telecommands, to which cFS's TO_LAB sends"
    parser.add_argument("--listen", type=read_address, default="127.0.0.1:1235", help=listen)
    parser.add_argument(
        "--send", type=read_address, default="127.0.0.1:1234", help="address of telemetry: cFS's CI_LAB"
    )
    given = parser.parse_args()
    try:
        with (
            rl.loop.Client(given.server, name="cFS bridge") as simulation,
            socket.socket(type=socket.SOCK_DGRAM) as link,
        ):
            link.bind(given.listen)
            print(f"telecommands at {given.listen[0]}:{given.listen[1]}", flush=True)
            Bridge(simulation).run(link, given.send)
    except rl.RsoLidarError as error:
        raise SystemExit(f"bridge.py: {error}") from None
    except OSError as error:
        raise SystemExit(f"bridge.py: {given.listen[0]}:{given.listen[1]}: {error.strerror}") from None


if __name__ == "__main__":
    main()
