//! Hooks that reach real systems: over HTTPS, with tokens that nobody reads afterwards.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{ServerConfig, ServerConnection, StreamOwned, crypto::ring};

use crate::bench::{Bench, Profile};
use crate::certificates;
use crate::tool::{Running, tool};

/// Asks for an emergency stop and its release.
const STOP: &str = "state/emergency-stop";

/// A fleet manager that speaks HTTPS: it answers what the path says, and keeps what it was asked.
struct Fleet {
    port: u16,
    asked: Arc<Mutex<Vec<String>>>,
}

impl Fleet {
    fn start(folder: &Path) -> Self {
        let chain = CertificateDer::pem_file_iter(folder.join("server.crt")).unwrap();
        let chain = chain.map(Result::unwrap).collect();
        let key = PrivateKeyDer::from_pem_file(folder.join("server.key")).unwrap();
        let config = ServerConfig::builder_with_provider(ring::default_provider().into())
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_no_client_auth()
            .with_single_cert(chain, key)
            .unwrap();
        let config = Arc::new(config);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&asked);
        std::thread::spawn(move || {
            for socket in listener.incoming() {
                let connection = ServerConnection::new(Arc::clone(&config)).unwrap();
                answer(StreamOwned::new(connection, socket.unwrap()), &kept);
            }
        });
        Self { port, asked }
    }

    fn url(&self, path: &str) -> String {
        format!("https://localhost:{}/{path}", self.port)
    }
}

fn answer(mut stream: StreamOwned<ServerConnection, TcpStream>, asked: &Mutex<Vec<String>>) {
    let mut request = Vec::new();
    let mut part = [0; 4096];
    while !request.windows(4).any(|end| end == b"\r\n\r\n") {
        match stream.read(&mut part) {
            Ok(length @ 1..) => request.extend_from_slice(&part[..length]),
            _ => return,
        }
    }
    let request = String::from_utf8(request).unwrap();
    let code = request
        .split('/')
        .nth(1)
        .unwrap()
        .split(['?', ' '])
        .next()
        .unwrap()
        .to_owned();
    asked.lock().unwrap().push(request);
    let _ = write!(
        stream,
        "HTTP/1.1 {code} Because\r\ncontent-length: 0\r\nconnection: close\r\n\r\n"
    );
    let _ = stream.flush();
}

/// Everything a run has written, by file.
fn written(bench: &Bench) -> Vec<(PathBuf, String)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(bench.bundle())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .collect();
    files.push(bench.path().join("run.log"));
    files
        .into_iter()
        .map(|path| {
            let bytes = std::fs::read(&path).unwrap();
            (path, String::from_utf8_lossy(&bytes).into_owned())
        })
        .collect()
}

#[test]
fn a_request_with_a_token_is_made_over_https_and_no_secret_is_left_anywhere() {
    const SECRETS: [&str; 4] = ["token-of-env", "token-of-file", "token-of-url", "password-of-url"];
    let bench = Bench::new();
    certificates::make(bench.path());
    let fleet = Fleet::start(bench.path());
    std::fs::write(bench.path().join("key"), "token-of-file\n").unwrap();
    let mut profile = Profile::impatient();
    profile.bench = "tls-ca = \"ca.crt\"\n".to_owned();
    let stop = fleet
        .url("204?key=token-of-url")
        .replace("https://", "https://me:password-of-url@");
    profile.more = format!(
        "[hooks.emergency-stop]\nhttp = {{ url = \"{stop}\", headers = {{ Authorization = \"Bearer ${{env:FLEET_TOKEN}}\", X-Key = \
         \"${{file:key}}\", X-Vehicle = \"{{serial-number}}\" }} }}\n\
         [hooks.release-emergency-stop]\nrun = [\"sh\", \"-c\", \"echo token-of-env; echo $FLEET_TOKEN token-of-file >&2; exit 1\"]\n\
         [hooks.after-start]\nrun = [\"touch\", \"was-given-its-position\"]\n"
    );
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    let mut command = tool(
        bench.path(),
        &["run", "--profile", "device.toml", "-vv", "--log-file", "run.log", STOP],
    );
    command.env("FLEET_TOKEN", "token-of-env");
    let mut run = Running::start(&mut command);
    let address = run.line("the device is expected at mqtt://");
    let port = address.rsplit(':').next().unwrap().parse().unwrap();
    let _agv = bench.agv(port, &[]);
    let ended = run.end();
    let asked = fleet.asked.lock().unwrap().join("\n");
    for header in [
        "authorization: Bearer token-of-env",
        "x-key: token-of-file",
        "x-vehicle: 0001",
    ] {
        assert!(
            asked.lines().any(|line| line.eq_ignore_ascii_case(header)),
            "no `{header}` in {asked}\n{}\n{}",
            ended.status,
            ended.stderr
        );
    }
    let journal = std::fs::read_to_string(bench.bundle().join("journal.jsonl")).unwrap();
    assert!(journal.contains("/204?…: 204"), "the request is not in the journal");
    let place = |text: &str| journal.find(text).unwrap_or_else(|| panic!("no {text}"));
    assert!(place("\"hook\":\"after-start\"") < place("\"kind\":\"test-begun\""));
    assert!(bench.path().join("was-given-its-position").exists());
    let mut all = written(&bench);
    all.push(("stdout".into(), ended.stdout));
    all.push(("stderr".into(), ended.stderr));
    for (file, text) in &all {
        for secret in SECRETS {
            assert!(!text.contains(secret), "{secret} stands in {}", file.display());
        }
    }
    let log = std::fs::read_to_string(bench.path().join("run.log")).unwrap();
    assert!(
        log.contains("emergency-stop"),
        "the log does not tell of the hook:\n{log}"
    );
}

#[test]
fn conflict_and_not_to_be_processed_are_understood_and_refused() {
    for code in ["409", "422"] {
        let bench = Bench::new();
        certificates::make(bench.path());
        let fleet = Fleet::start(bench.path());
        let mut profile = Profile::impatient();
        profile.bench = "tls-ca = \"ca.crt\"\n".to_owned();
        let url = fleet.url(code);
        profile.more = format!(
            "[hooks.emergency-stop]\nhttp = {{ url = \"{url}\" }}\n[hooks.release-emergency-stop]\nhttp = {{ url = \"{url}\" }}\n"
        );
        let (run, port) = bench.start(&profile, &[STOP]);
        let _agv = bench.agv(port, &[]);
        run.end().code(3);
        let test = bench.result()["tests"][0].clone();
        assert_eq!(test["verdict"], "inconclusive", "{test}");
        let reason = test["reason"].as_str().unwrap();
        assert!(
            reason.contains("the device refuses what hook `emergency-stop` asks for"),
            "{reason}"
        );
    }
}

#[test]
fn a_server_that_nobody_vouches_for_and_a_token_that_is_not_there_are_named() {
    let bench = Bench::new();
    certificates::make(bench.path());
    let fleet = Fleet::start(bench.path());
    let hooks = |headers: &str| {
        let url = fleet.url("204");
        format!(
            "[hooks.emergency-stop]\nhttp = {{ url = \"{url}\"{headers} }}\n[hooks.release-emergency-stop]\nrun = \"true\"\n"
        )
    };
    let mut profile = Profile::impatient();
    profile.more = hooks("");
    let (run, port) = bench.start(&profile, &[STOP]);
    let agv = bench.agv(port, &[]);
    let ended = run.end().code(5);
    assert!(ended.stdout.contains("UnknownIssuer"), "{}", ended.stdout);
    assert!(fleet.asked.lock().unwrap().is_empty());
    drop(agv);
    profile.more = hooks(", headers = { Authorization = \"${env:NO_SUCH_TOKEN}\" }");
    std::fs::write(bench.path().join("device.toml"), profile.text()).unwrap();
    bench
        .run(&["run", "--profile", "device.toml", STOP])
        .code(2)
        .says("NO_SUCH_TOKEN");
}
