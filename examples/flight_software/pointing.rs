// Flight software in Rust: the twin of pointing.c. NOT RUN by the tests: a text to start from.
// Cargo.toml: zmq = "0.10", serde_json = "1"
use serde_json::{json, Value};
use std::collections::HashMap;

type Arrays = HashMap<String, Vec<u8>>;

fn ask(socket: &zmq::Socket, request: Value) -> (Value, Arrays) {
    socket.send(request.to_string().as_str(), 0).expect("send");
    let mut parts = socket.recv_multipart(0).expect("no answer; see whether the server runs").into_iter();
    let header: Value = serde_json::from_slice(&parts.next().unwrap()).expect("header");
    assert!(header["ok"] == true, "{}", header["error"]["message"]);
    let names = header["arrays"].as_array().unwrap().iter();
    let arrays = names.map(|entry| entry["name"].as_str().unwrap().to_owned()).zip(parts).collect();
    (header, arrays)
}

fn f64s(bytes: &[u8]) -> Vec<f64> {
    bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
}

fn f32s(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

fn main() {
    let endpoint = std::env::args().nth(1).unwrap_or("tcp://127.0.0.1:5571".into());
    let socket = zmq::Context::new().socket(zmq::REQ).unwrap();
    socket.set_rcvtimeo(60_000).unwrap();
    socket.connect(&endpoint).expect("connect");
    ask(&socket, json!({"request": "hello", "version": 1, "client": "pointing.rs"}));
    let (mut sight, mut command) = (Vec::new(), Value::Null);
    loop {
        let (header, arrays) = ask(&socket, json!({"request": "step", "command": command}));
        if let Some(bytes) = arrays.get("line_of_sight") {
            sight = f64s(bytes);
        }
        if let Some(bytes) = arrays.get("reading/range_m") {
            let range_m = f32s(bytes);
            let mut found: Vec<f32> = range_m.iter().copied().filter(|r| r.is_finite()).collect();
            found.sort_by(f32::total_cmp);
            let median_m = found.get(found.len() / 2).copied().unwrap_or(f32::NAN);
            let seen: Vec<usize> = (0..range_m.len()).filter(|&k| (range_m[k] - median_m).abs() <= 15.0).collect();
            if seen.len() >= 4 {
                let toward = |axis: usize| seen.iter().map(|&k| sight[3 * k + axis]).sum::<f64>();
                let (x, y, z) = (toward(2), -toward(0), -toward(1)); // PTU axes at the measured angles
                let measured = f64s(&arrays["pan_tilt_rad"]);
                let forward = x * measured[1].cos() - z * measured[1].sin();
                let up = x * measured[1].sin() + z * measured[1].cos();
                command = json!({"pan_rad": measured[0] + y.atan2(forward), "tilt_rad": up.atan2(forward.hypot(y))});
            }
        }
        if header["is_over"] == true {
            break;
        }
    }
    ask(&socket, json!({"request": "shutdown"}));
}
