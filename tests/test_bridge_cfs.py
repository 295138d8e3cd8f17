"""The bridge to cFS: packets that other readers understand, and telecommands that are carried out or refused."""

import socket
import struct
import sys
import threading
import types
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.loop.service.linked_simulation import LinkedSimulation
from tests.loop.service.serving import serving
from tests.settings_for_tests import limit_pixels

spacepackets = pytest.importorskip("spacepackets.ccsds.spacepacket", reason="spacepackets is not installed")
pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
FOLDER = EXAMPLES / "bridges" / "cfs"
SMALL = (
    "time.duration_s=3",
    *limit_pixels(32, 1),
)
READING, POINTS, SAMPLE, HOUSEKEEPING, COMMAND = 0x1A0, 0x1A1, 0x1A2, 0x1A3, 0x1A8
NOOP, RESET, STEP, UNTIL, POINT, INPUTS, MODE, SHUT_DOWN = range(8)


@pytest.fixture(scope="module")
def example():
    """The modules of the example."""
    sys.path.insert(0, str(FOLDER))
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # nothing lands among the examples
    try:
        import bridge
        import packets

        yield types.SimpleNamespace(Bridge=bridge.Bridge, packets=packets)
    finally:
        sys.path.remove(str(FOLDER))
        sys.dont_write_bytecode = before
        for name in ("bridge", "packets"):
            sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def scenario():
    """Six flashes at a tumbling stage from a craft with a PTU and a gyro, over a link without losses."""
    whole = rl.Scenario.load(EXAMPLES / "flight_software" / "tumbling_stage.toml", settings=SMALL)
    link = whole.link.replace(drop_probability=0.0)
    return whole.replace(link=link, sensor=(rl.sensors.Gyro(name="gyro", rate_hz=10.0),))


def telecommand(function, data=b"", *, count=0, apid=COMMAND, first=0x18):
    """Return a telecommand, made by hand."""
    head = struct.pack(">BBHH", first | apid >> 8, apid & 0xFF, 0xC000 | count, 1 + len(data))
    packet = bytearray(head + bytes([function, 0]) + data)
    total = 0xFF
    for byte in packet:
        total ^= byte
    packet[7] = total
    return bytes(packet)


def read(packet):
    """Return APID, sequence flags and count, time [ns] and data of telemetry, read by hand."""
    stream, sequence, length = struct.unpack_from(">HHH", packet)
    assert len(packet) == length + 7 <= 768
    assert stream >> 11 == 1  # version 0, telemetry, secondary header
    seconds, part, spare = struct.unpack_from(">IHI", packet, 6)
    assert spare == 0
    return stream & 0x7FF, sequence >> 14, sequence & 0x3FFF, (seconds + part / 65536) * 1e9, packet[16:]


def read_all(packets):
    """Return the data of packets by APID."""
    found = {apid: [] for apid in (READING, POINTS, SAMPLE, HOUSEKEEPING)}
    for packet in packets:
        apid, *_, data = read(packet)
        found[apid].append(data)
    return found


@contextmanager
def bridging(example, scenario):
    """Yield a bridge to a served scenario, and the lines of its warnings."""
    lines = []
    with serving(scenario) as server, rl.loop.Client(server.endpoint) as client:
        yield example.Bridge(client, lines.append), lines


@pytest.fixture(scope="module")
def flown(example, scenario):
    """Packets of each flash: the bridge over UDP; the PTU is commanded after the second flash."""
    answers = []
    with serving(scenario) as server, rl.loop.Client(server.endpoint) as client, ExitStack() as sockets:
        ends = [sockets.enter_context(socket.socket(type=socket.SOCK_DGRAM)) for _ in range(2)]
        for end in ends:
            end.bind(("127.0.0.1", 0))
            end.settimeout(20.0)
        bridge = example.Bridge(client)
        thread = threading.Thread(target=bridge.run, args=(ends[0], ends[1].getsockname()))
        thread.start()

        def ask(packet):
            ends[1].sendto(packet, ends[0].getsockname())
            got = []
            while not got or read(got[-1])[0] != HOUSEKEEPING:
                got.append(ends[1].recv(65536))
            return got

        for number in range(scenario.time.n_frames):
            if number == 2:
                ask(telecommand(POINT, struct.pack(">dd", 0.775, 0.01)))
            answers.append(ask(telecommand(STEP, struct.pack(">I", number))))
        last = ask(telecommand(SHUT_DOWN))
        thread.join(20.0)
        assert not thread.is_alive()
    return answers, last


def test_readings_over_udp_are_those_of_the_simulation(scenario, flown):
    linked = LinkedSimulation(rl.Simulation(scenario, threads=1))
    previous = 0
    for number, answer in enumerate(flown[0]):
        command = rl.Command(pan_rad=0.775, tilt_rad=0.01) if number >= 2 else rl.Command()
        flash, packets = linked.step(command), read_all(answer)
        seen = flash.observation
        valid = np.isfinite(seen.reading.range_m)
        (data,) = packets[READING]
        fields = struct.unpack(">IBBHqqddIfffffHHI", data)
        assert len(data) == 72
        assert fields[:2] == (number, 0)
        assert fields[2] == 2 + 4 + 8 + (number == 5)
        assert fields[3] == len(packets[POINTS])
        assert fields[4:6] == (flash.t_emission_ns, flash.t_available_ns)
        assert fields[6:8] == tuple(seen.pan_tilt_rad)
        assert fields[8] == valid.sum() > 20
        median_m = np.median(seen.reading.range_m[valid])
        assert fields[9:11] == pytest.approx((median_m, seen.reading.range_m[valid].min()), rel=1e-6)
        near = valid & (np.abs(seen.reading.range_m - median_m) < 15.0)
        towards = seen.line_of_sight[near].sum(axis=0)
        assert fields[11:14] == pytest.approx(tuple(towards / np.linalg.norm(towards)), abs=1e-6)
        assert fields[14:] == (seen.reading.intensity_counts.max(), seen.reading.saturated.sum(), 0)

        points = [struct.unpack_from(">HHfffHBB", one, at) for one in packets[POINTS] for at in range(8, len(one), 20)]
        rows, cols = np.nonzero(valid)
        assert [point[:2] for point in points] == list(zip(rows, cols, strict=True))
        np.testing.assert_array_equal([point[2:5] for point in points], seen.points_m[valid].astype("f4"))
        assert [point[5] for point in points] == seen.reading.intensity_counts[valid].tolist()

        gyro = linked.samples["gyro"]
        assert len(packets[SAMPLE]) == len(gyro.time_s) == (5 if number else 1)
        for k, one in enumerate(packets[SAMPLE]):
            sensor, kind, usable, n_values, _, at_ns, _, *rate = struct.unpack(">BBBBIqq3d", one)
            assert (sensor, kind, usable, n_values) == (0, 1, 1, 3)
            assert at_ns == round(gyro.time_s[k] * 1e9)
            assert rate == gyro.angular_velocity_rad_s[k].tolist()
        time_ns = struct.unpack_from(">q", packets[HOUSEKEEPING][0], 32)[0]
        assert time_ns == flash.t_emission_ns >= previous
        assert 0 <= time_ns - read(answer[0])[3] < 1e9 / 65536
        previous = time_ns


def test_points_are_in_a_group_of_packets_and_all_are_counted(flown):
    counts = {apid: [] for apid in (READING, POINTS, SAMPLE, HOUSEKEEPING)}
    for answer in [*flown[0], flown[1]]:
        read_packets = [read(packet) for packet in answer]
        for apid, _, count, _, _ in read_packets:
            counts[apid].append(count)
        flags = [one[1] for one in read_packets if one[0] == POINTS]
        assert flags in ([], [3]) or flags == [1] + [0] * (len(flags) - 2) + [2]
        assert all(one[1] == 3 for one in read_packets if one[0] != POINTS)
    assert len(counts[POINTS]) > 6
    for series in counts.values():
        start = series[0]  # of housekeeping, POINT's answer is missing
        assert np.all(np.diff(series) >= 1) and start == 0
    assert counts[POINTS] == list(range(len(counts[POINTS])))


def test_other_libraries_read_the_same(flown):
    """spacepackets reads the headers, and space_packet_parser all of it by the XTCE file, which is valid XTCE 1.2."""
    spp = pytest.importorskip("space_packet_parser", reason="space_packet_parser is not installed")
    schema = next((Path(spp.__file__).parent / "xtce" / "schemas").glob("*.xsd"))
    assert spp.validate_xtce(FOLDER / "lidar.xml", local_xsd=schema, print_results=False).valid
    definition = spp.load_xtce(FOLDER / "lidar.xml")
    names = ("FRAME", "STATUS", "FLAGS", "POINT_PACKETS", "T_EMISSION", "T_AVAILABLE", "PAN", "TILT", "N_RETURNS")
    names += ("MEDIAN_RANGE", "NEAREST_RANGE", "CENTROID_X", "CENTROID_Y", "CENTROID_Z", "MAX_INTENSITY", "N_SATURATED")
    counters = ("ACCEPTED", "REFUSED_LENGTH", "REFUSED_APID", "REFUSED_CHECKSUM", "REFUSED_FUNCTION", "REFUSED_FAILED")
    for packet in flown[0][-1]:
        apid, flags, count, _, data = read(packet)
        header = spacepackets.SpacePacketHeader.unpack(packet)
        assert (header.apid, int(header.seq_flags), header.seq_count, header.packet_len) == (
            apid, flags, count, len(packet)
        )  # fmt: skip
        parsed = definition.parse_bytes(packet)
        assert (parsed["PKT_APID"], parsed["SRC_SEQ_CTR"], parsed["PKT_LEN"] + 7) == (apid, count, len(packet))
        assert parsed["TIME_S"] == 2 and parsed["TIME_SUBSECONDS"] == 32768
        if apid == READING:
            by_hand = struct.unpack_from(">IBBHqqddIfffffHH", data)
            assert tuple(parsed[name] for name in names) == by_hand
        elif apid == POINTS:
            assert bytes(parsed["POINTS_DATA"]) == data[8:] and parsed["N_POINTS"] * 20 == len(data) - 8
        elif apid == SAMPLE:
            assert (
                bytes(parsed["VALUES_DATA"]) == data[24:] and parsed["T_SAMPLE"] == struct.unpack_from(">q", data, 8)[0]
            )
        else:
            assert tuple(parsed[name] for name in (*counters, "LOST")) == (7, 0, 0, 0, 0, 0, 0)
            assert (parsed["LAST_FUNCTION"], parsed["STEP_MODE"], parsed["TIME_NS"]) == (STEP, 0, 2_500_000_000)


def test_the_examples_own_telecommands_are_those_made_by_hand(example):
    pack = example.packets.pack_command
    assert pack(STEP, 7, count=3) == telecommand(STEP, struct.pack(">I", 7), count=3)
    by_hand = b"follower.attitude".ljust(24, b"\0") + bytes([2]) + bytes(7) + struct.pack(">dd", 0.5, -1.0)
    assert pack(INPUTS, "follower.attitude", 0.5, -1.0) == telecommand(INPUTS, by_hand)
    assert telecommand(NOOP) == bytes.fromhex("19a8c0000001008f")  # 0xFF ^ 19 ^ a8 ^ c0 ^ 01 = 8f
    assert example.packets.checksum(telecommand(NOOP)) == 0


def test_what_is_no_telecommand_is_counted_and_refused_in_one_line(example, scenario):
    good = telecommand(STEP, struct.pack(">I", 0))
    wrong = {
        "length": [b"", good[:5], good[:-1], good + b"\0", telecommand(NOOP)[:7], telecommand(NOOP)[:2] + b"\0" * 6],
        "apid": [telecommand(NOOP, apid=0x1A9), telecommand(NOOP, first=0x08), telecommand(NOOP, first=0x38)],
        "checksum": [good[:-1] + b"\x01", good[:7] + bytes([good[7] ^ 0x80]) + good[8:]],
        "function": [
            telecommand(99), telecommand(STEP), telecommand(NOOP, b"\0"), telecommand(0x80 | STEP, struct.pack(">I", 0)),
            telecommand(INPUTS, bytes(31)), telecommand(INPUTS, bytes(24) + b"\x02" + bytes(15)), telecommand(MODE, b"\x07"),
        ],
        "failed": [
            telecommand(STEP, struct.pack(">I", 3)), telecommand(UNTIL, struct.pack(">Q", 2_000_000_000)),
            telecommand(UNTIL, struct.pack(">Q", 2**64 - 1)), telecommand(POINT, struct.pack(">dd", np.inf, 0.0)),
            telecommand(INPUTS, b"follower".ljust(24, b"\0") + b"\x01" + bytes(7) + struct.pack(">d", np.nan)),
        ],
    }  # fmt: skip
    with bridging(example, scenario.replace(link=None)) as (bridge, lines):
        for reason, packets in wrong.items():
            for number, packet in enumerate(packets):
                before = len(lines)
                (answer,) = bridge.answer(packet)
                counters = struct.unpack(">7I", read(answer)[-1][:28])
                assert counters[1 + example.packets.REASONS.index(reason)] == number + 1, packet.hex()
                assert len(lines) == before + 1 and "\n" not in lines[-1]
        assert counters == (0, 6, 3, 2, 7, 5, 0)
        bridge.answer(telecommand(INPUTS, b"nobody".ljust(32, b"\0")))  # refused when it would act, and then discarded
        assert len(bridge.answer(good)) == 1 and "nobody" in lines[-1]
        assert len(bridge.answer(good)) > 2
        random = np.random.default_rng(1)
        for _ in range(300):
            noise = bytearray(random.bytes(random.integers(0, 60)))
            noise[:2] = telecommand(NOOP)[: min(2, len(noise))]
            assert len(bridge.answer(bytes(noise))) == 1


def test_gaps_in_the_sequence_count_are_reported(example, scenario):
    with bridging(example, scenario) as (bridge, lines):
        for count, lost in ((5, 0), (6, 0), (9, 2), (16383, 2 + 16373), (0, 16375), (1, 16375), (0, 16375), (0, 16375)):
            (answer,) = bridge.answer(telecommand(NOOP, count=count))
            assert struct.unpack_from(">I", read(answer)[-1], 24)[0] == lost
        assert lines == ["telecommands: 2 lost before number 9", "telecommands: 16373 lost before number 16383"]
        (answer,) = bridge.answer(telecommand(RESET))
        assert struct.unpack_from(">7I", read(answer)[-1]) == (1, 0, 0, 0, 0, 0, 0)


def test_a_repeated_step_does_not_step_twice(example, scenario):
    with bridging(example, scenario) as (bridge, lines):
        first = bridge.answer(telecommand(STEP, struct.pack(">I", 0)))
        assert bridge.answer(telecommand(STEP, struct.pack(">I", 0)))[:-1] == first[:-1]
        until = telecommand(UNTIL, struct.pack(">Q", 400_000_000))
        second = bridge.answer(until)
        assert read_all(second)[SAMPLE] and bridge.answer(until)[:-1] == second[:-1]
        assert bridge.time_ns == 400_000_000 and not lines


def test_thrust_reaches_the_body_and_mode_1_flies_by_itself(example):
    settings = (*SMALL, *limit_pixels(8, 1))
    scenario = rl.Scenario.load(EXAMPLES / "thrusters.toml", settings=settings, trust_code=True)
    inputs = b"follower".ljust(24, b"\0") + bytes([3]) + bytes(7) + struct.pack(">3d", 0.02, 0.0, 0.0)
    session = rl.loop.Session(rl.Simulation(scenario, threads=1), serves_truth=True)
    with serving(scenario, session=session) as server, rl.loop.Client(server.endpoint) as client:
        bridge = example.Bridge(client)
        bridge.answer(telecommand(INPUTS, inputs))
        bridge.answer(telecommand(MODE, b"\x01"))

        class Link:
            """A socket that receives nothing until the run is over, and then the telecommand to end."""

            def settimeout(self, wait_s):
                self.is_stepping = wait_s == 0.0

            def recv(self, _):
                if self.is_stepping:
                    raise BlockingIOError
                self.truth = client.truth
                return telecommand(SHUT_DOWN)

            def sendto(self, packet, peer):
                sent.append(read(packet))

        sent, link = [], Link()
        bridge.run(link, None)
    assert [struct.unpack_from(">I", one[-1])[0] for one in sent if one[0] == READING] == [0, 1, 2]
    simulation = rl.Simulation(scenario, threads=1)
    for _ in range(3):
        frame = simulation.step(rl.Command(inputs={"follower": (0.02, 0.0, 0.0)}))
    ours, theirs = (one.pose("stage.rtn", "follower").translation for one in (link.truth, frame.truth))
    np.testing.assert_array_equal(ours, theirs)


def test_a_lost_reading_is_reported(example, scenario):
    lossy = scenario.replace(link=scenario.link.replace(drop_probability=1.0))
    with bridging(example, lossy) as (bridge, _):
        packets = read_all(bridge.answer(telecommand(STEP, struct.pack(">I", 0))))
        (data,) = packets[READING]
        index, status, flags, groups, emission_ns, available_ns, pan, *_ = struct.unpack_from(">IBBHqqd", data)
        assert (index, status, flags, groups, emission_ns, available_ns) == (0, 1, 0, 0, 0, -1)
        assert np.isnan(pan) and not packets[POINTS]
