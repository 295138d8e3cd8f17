"""A simulation over a socket: the same bits as in one process, one driver, and clear answers to what is wrong."""

import json

import numpy as np
import pytest

import rso_lidar as rl
from tests.loop.service.serving import serving

pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")


def pointing():
    return rl.track.Pointing(gate_m=20.0, lead_s=0.16)


def test_a_loop_over_the_socket_has_the_bits_of_simulate(scenario):
    controller = pointing()
    with serving(scenario) as server, rl.loop.Client(server.endpoint, timeout_s=30) as client:
        flashes = [client.step()]
        while not client.is_over:
            flashes.append(client.step(controller(client.observation)))
        truth = client.truth
    frames = list(rl.simulate(scenario, pointing()))
    assert len(flashes) == len(frames) == 8
    for flash, frame in zip(flashes, frames, strict=True):
        seen = flash.observation
        assert (flash.index, flash.status) == (frame.index, "delivered")
        assert flash.t_emission_ns == flash.t_available_ns == round(frame.time_s * 1e9)
        np.testing.assert_array_equal(seen.reading.range_m, frame.range_m)
        np.testing.assert_array_equal(seen.reading.intensity_counts, frame.intensity_counts)
        np.testing.assert_array_equal(seen.pan_tilt_rad, frame.observation.pan_tilt_rad)
        np.testing.assert_array_equal(seen.line_of_sight, frame.line_of_sight)
        assert seen.settings == frame.observation.settings
    last = frames[-1].truth
    assert truth.time_s == last.time_s
    assert set(truth.poses) == set(last.poses)
    np.testing.assert_allclose(
        truth.pose("lidar", "stage").as_matrix(), last.pose("lidar", "stage").as_matrix(), rtol=0, atol=1e-9
    )
    np.testing.assert_array_equal(truth.states["stage"].velocity_m_s, last.states["stage"].velocity_m_s)
    np.testing.assert_array_equal(truth.pointing.demand_rad, last.pointing.demand_rad)


def test_reset_save_and_restore_over_the_socket(scenario):
    with serving(scenario) as server, rl.loop.Client(server.endpoint, timeout_s=30) as client:
        first = client.step()
        client.step(rl.Command(pan_rad=0.7))
        state = client.save()
        third = client.step(rl.Command(pan_rad=np.float64(0.72)))
        client.restore(state)
        assert client.time_s == 0.5
        again = client.step(rl.Command(pan_rad=0.72))
        np.testing.assert_array_equal(again.observation.pan_tilt_rad, third.observation.pan_tilt_rad)
        client.reset()
        assert client.observation is None
        same = client.step()
        np.testing.assert_array_equal(same.observation.reading.range_m, first.observation.reading.range_m)
        client.reset(seed=99)
        other = client.step()
        assert not np.array_equal(other.observation.pan_tilt_rad, first.observation.pan_tilt_rad)
        with pytest.raises(rl.ScenarioError, match="no state 'state-7' is kept"):
            client.restore("state-7")


def test_one_driver_at_a_time_and_the_next_one_goes_on(scenario):
    with serving(scenario) as server:
        with rl.loop.Client(server.endpoint, name="first", timeout_s=30) as client:
            client.step()
            with pytest.raises(rl.ScenarioError, match="'first' is the driver already; end it first"):
                rl.loop.Client(server.endpoint, timeout_s=30)
            with rl.loop.Client(server.endpoint, role="observer", timeout_s=30) as watcher:
                assert watcher.read().index == 0
                with pytest.raises(rl.ScenarioError, match="step: is for the driver"):
                    watcher.step()
        with rl.loop.Client(server.endpoint, name="second", timeout_s=30) as client:
            assert client.time_s == 0.0
            assert client.step().index == 1


def test_a_wrong_request_is_refused_at_once(scenario):
    """The refusal of a request that is none repeats its number, so that its client does not wait until the timeout."""
    with serving(scenario) as server, rl.loop.Client(server.endpoint, timeout_s=30) as client:
        for options, told in (
            ({"dt_s": 0.0}, "step: dt_ns: should be greater than or equal to 1"),
            ({"command": rl.Command(energy_j=-1.0)}, "step: command.energy_j: should be greater than 0"),
        ):
            with pytest.raises(rl.ScenarioError, match=told):
                client.step(**options)
        assert client.step().index == 0


def test_a_client_that_asks_for_structures_gets_them_and_the_stream_stays_json(scenario):
    import zmq

    with serving(scenario, publish="tcp://127.0.0.1:*") as server, zmq.Context() as context:
        with context.socket(zmq.REQ) as plug, context.socket(zmq.SUB) as stream:
            plug.rcvtimeo = stream.rcvtimeo = 30_000
            stream.subscribe("reading")
            stream.connect(server.stream)
            plug.connect(server.endpoint)

            def ask(text):
                plug.send_string(text)
                return plug.recv_multipart()

            assert ask('{"request": "step"}')[0][:1] == b"{"  # before hello
            hello, *_ = ask('{"request": "hello", "version": 1, "head": "struct"}')
            reply, *_ = ask('{"request": "step", "sequence": 9}')
            refusal = ask('{"request": "step", "dt_ns": 0, "sequence": 10}')
            _, published, *_ = stream.recv_multipart()
    assert [head[:6] for head in (hello, reply)] == [b"RSOL\x01\x01", b"RSOL\x01\x03"]
    assert int.from_bytes(reply[16:24], "little") == 9
    assert len(refusal) == 1 and refusal[0][:6] == b"RSOL\x01\x00" and b"step: dt_ns: should be greater" in refusal[0]
    assert json.loads(published)["frame"]["index"] == 0


LENS = {"f_number": 4, "n_rows": 12, "n_cols": 16}
CAMERAS = [
    {"name": "nav", "bands": "rgb", "lens": LENS | {"fov_deg": 10}, "mount": {"euler_zyx_deg": [20, -5, 3]}},
    {"name": "wide", "carrier": "ptu", "lens": LENS | {"fov_deg": 40}, "mount": {"position_m": [0, 0.3, 0]}},
]
# An entry of a head of structures, as docs/protocol.md states it
ENTRY = np.dtype([("name_at", "<u4"), ("dtype", "S4"), ("n_dims", "<u4"), ("shape", "<u4", 4), ("part", "<u4")])


def read_structs(head, *parts):
    """Return the arrays of a message whose head is structures, by path."""
    arrays = {}
    for entry in np.frombuffer(head, ENTRY, int.from_bytes(head[84:88], "little"), 88):
        name = head[entry["name_at"] : head.index(b"\0", entry["name_at"])].decode()
        shape = entry["shape"][: entry["n_dims"]]
        arrays[name] = np.frombuffer(parts[entry["part"] - 1], entry["dtype"].decode()).reshape(shape)
    return arrays


def test_images_reach_the_clients_that_ask_for_them_and_no_byte_of_others_changes(scenario):
    import zmq

    with_cameras = scenario.replace(camera=CAMERAS)
    (frame,) = rl.simulate(with_cameras, frames=[0])

    def listen(flown, hello=""):
        """Return the replies to three requests of a plain client, and the stream until the last camera's image."""
        messages = []
        with serving(flown, publish="tcp://127.0.0.1:*") as server, zmq.Context() as context:
            with context.socket(zmq.REQ) as plug, context.socket(zmq.SUB) as stream:
                plug.rcvtimeo = stream.rcvtimeo = 30_000
                stream.subscribe("reading" if flown is scenario else "")
                stream.connect(server.stream)
                plug.connect(server.endpoint)
                for text in (f'"hello", "version": 1{hello}', '"step"', '"observation"'):
                    plug.send_string(f'{{"request": {text}}}')
                    messages.append(plug.recv_multipart())
                published = [stream.recv_multipart() for _ in range(1 if flown is scenario else 3)]
        return messages, published

    plain, (reading,) = listen(scenario)
    unasked, (same, *of_cameras) = listen(with_cameras)
    assert unasked == plain and same == reading
    (_, *asked), (still_same, *_) = listen(with_cameras, ', "head": "struct", "cameras": ["wide"]')
    assert still_same == reading
    for message in asked:
        arrays = read_structs(*message)
        assert [name for name in arrays if name.startswith("camera/")] == [
            "camera/wide/intensity_counts",
            "camera/wide/exposure_s",
        ]
        np.testing.assert_array_equal(arrays["camera/wide/intensity_counts"], frame.camera["wide"].intensity_counts)
        assert arrays["camera/wide/exposure_s"] == 1e-3
    for (topic, head, image, exposure), (name, taken) in zip(of_cameras, frame.camera.items(), strict=True):
        assert topic.decode() == f"camera/{name}" and json.loads(head)["frame"]["index"] == 0
        assert json.loads(head)["records"] == {f"camera/{name}": "CameraImage"}
        assert (image, exposure) == (taken.intensity_counts.tobytes(), taken.exposure_s.tobytes())

    with serving(with_cameras) as server:
        with pytest.raises(rl.ScenarioError, match="hello: cameras: no 'nave'; did you mean 'nav'"):
            rl.loop.Client(server.endpoint, timeout_s=30, cameras=["nave"])
        with rl.loop.Client(server.endpoint, timeout_s=30, cameras="all") as client:
            seen = client.step().observation.camera
            assert list(seen) == ["nav", "wide"]
            for name, taken in frame.camera.items():
                np.testing.assert_array_equal(seen[name].intensity_counts, taken.intensity_counts)
            described = {table["name"]: table for table in client.description["cameras"]}
    assert described["nav"]["fx"] == pytest.approx(
        8.0 / np.tan(np.deg2rad(5.0))
    )  # half of 16 columns see half of 10 deg
    for name, table in described.items():  # flight software places the camera as the simulation does
        pose = frame.truth.pose(table["carrier"], name)
        np.testing.assert_allclose(table["position_m"], pose.translation, atol=1e-12)
        np.testing.assert_allclose(table["quaternion_xyzw"], pose.rotation.as_quat(canonical=True), atol=1e-12)
