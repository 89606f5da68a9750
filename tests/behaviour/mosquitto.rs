//! A broker that is not ours.

use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A mosquitto of this test's own. It is killed when the test is over.
pub struct Mosquitto {
    process: Child,
    pub port: u16,
    folder: tempfile::TempDir,
}

impl Mosquitto {
    /// Starts one. Without mosquitto on this machine: nothing, which in CI is a failure.
    pub fn start() -> Option<Self> {
        Self::start_with(|_| "allow_anonymous true\n".to_owned())
    }

    /// Starts one with these lines of its configuration, whose files may stand in the folder.
    pub fn start_with(configure: impl Fn(&Path) -> String) -> Option<Self> {
        // mosquitto refuses port 0, so a free one is guessed; another test may be faster, hence several tries.
        for _ in 0..5 {
            let port = free_port();
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("mosquitto.conf");
            let lines = configure(folder.path());
            std::fs::write(&file, format!("listener {port} 127.0.0.1\n{lines}")).unwrap();
            let Ok(process) = spawn(&file) else {
                assert!(
                    std::env::var_os("CI").is_none(),
                    "mosquitto is not installed, and CI must have it"
                );
                eprintln!("skipped: mosquitto is not installed");
                return None;
            };
            let mut this = Self { process, port, folder };
            if this.is_up() {
                return Some(this);
            }
        }
        panic!("mosquitto does not start");
    }

    /// Whether it takes connections before long.
    fn is_up(&mut self) -> bool {
        for _ in 0..200 {
            std::thread::sleep(Duration::from_millis(20));
            if self.process.try_wait().unwrap().is_some() {
                return false;
            }
            if TcpStream::connect(("127.0.0.1", self.port)).is_ok() {
                return true;
            }
        }
        false
    }

    /// Ends it without a warning, and starts it again on the same port once `meanwhile` is done.
    pub fn restart(&mut self, meanwhile: impl FnOnce()) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
        meanwhile();
        self.process = spawn(&self.folder.path().join("mosquitto.conf")).unwrap();
        assert!(self.is_up(), "mosquitto does not start again");
    }

    /// Where its files are.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    pub fn url(&self) -> String {
        format!("mqtt://127.0.0.1:{}", self.port)
    }

    /// Ends it without a warning.
    pub fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Mosquitto {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn spawn(file: &Path) -> std::io::Result<Child> {
    let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin:/usr/local/sbin";
    Command::new("mosquitto")
        .env("PATH", path)
        .arg("-c")
        .arg(file)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
}

/// A port where nobody listens.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}
