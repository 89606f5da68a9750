//! Clusters of brokers that are not ours: two nodes each on this machine, on ports of their own, with all files in a folder that is
//! gone afterwards.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::mosquitto::free_port;

/// How long two nodes may take to be one broker, on a machine as busy as it may be.
const LIMIT: Duration = Duration::from_secs(240);
/// How long a node may take to answer a client.
const ANSWER: Duration = Duration::from_secs(10);

/// A cluster of two nodes. Its processes are killed when the test is over, whatever became of it.
pub struct Cluster {
    /// The nodes first, in the order of the ports.
    processes: Vec<Process>,
    ports: [u16; 2],
    _folder: tempfile::TempDir,
}

/// A process with everything that it has started.
pub struct Process(Child);

impl Process {
    /// Starts it in a process group of its own; `None` where the program is not there, which in CI is a failure.
    pub fn start(command: &mut Command) -> Option<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt as _;
            command.process_group(0);
        }
        let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin:/usr/local/sbin";
        let started = command
            .env("PATH", path)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        match started {
            Ok(child) => Some(Self(child)),
            Err(error) => {
                let program = command.get_program().to_string_lossy().into_owned();
                assert!(
                    std::env::var_os("CI").is_none(),
                    "{program}: {error}, and CI must have it"
                );
                eprintln!("skipped: {program} is not installed");
                None
            }
        }
    }

    /// Whether it has ended by itself.
    pub fn has_ended(&mut self) -> bool {
        self.0.try_wait().unwrap().is_some()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The group, since a script starts what it is about.
        let _ = Command::new("kill")
            .args(["-KILL", "--", &format!("-{}", self.0.id())])
            .status();
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Cluster {
    /// Two nodes of `nats-server` with its MQTT.
    pub fn nats() -> Option<Self> {
        Self::start(|folder, ports| {
            let routes = [free_port(), free_port()];
            let mut nodes = Vec::new();
            for (number, port) in ports.iter().enumerate() {
                let file = folder.join(format!("node-{number}.conf"));
                let store = folder.join(format!("node-{number}"));
                let text = format!(
                    "server_name: node-{number}\nlisten: \"127.0.0.1:{}\"\n\
                     jetstream {{ store_dir: \"{}\", max_mem: 64MB, max_file: 256MB }}\n\
                     cluster {{ name: tck, listen: \"127.0.0.1:{}\", routes: [\"nats://127.0.0.1:{}\"] }}\n\
                     mqtt {{ host: \"127.0.0.1\", port: {port} }}\n",
                    free_port(),
                    store.display(),
                    routes[number],
                    routes[1 - number],
                );
                fs::write(&file, text).unwrap();
                nodes.push(Process::start(Command::new("nats-server").arg("-c").arg(&file))?);
            }
            Some(nodes)
        })
    }

    /// Two nodes of `rabbitmq-server` with its MQTT plugin, and the daemon by which they find each other.
    pub fn rabbitmq() -> Option<Self> {
        Self::start(|folder, ports| {
            let names = free_port();
            let home = folder.join("home");
            fs::create_dir_all(&home).unwrap();
            let cookie = home.join(".erlang.cookie");
            fs::write(&cookie, "two-nodes-of-a-test").unwrap();
            only_for_owner(&cookie);
            let plugins = folder.join("plugins");
            fs::write(&plugins, "[rabbitmq_mqtt].\n").unwrap();
            let empty = folder.join("nothing.conf");
            fs::write(&empty, "").unwrap();
            let daemon = ["-port", &names.to_string(), "-address", "127.0.0.1"];
            let daemon = Process::start(Command::new("epmd").args(daemon))?;
            // A node that finds none starts one of its own, which would outlive it.
            let begun = Instant::now();
            while TcpStream::connect(("127.0.0.1", names)).is_err() {
                assert!(begun.elapsed() < LIMIT, "epmd does not start");
                std::thread::sleep(Duration::from_millis(20));
            }
            let mut nodes = Vec::new();
            for (number, port) in ports.iter().enumerate() {
                let own = folder.join(format!("node-{number}"));
                fs::create_dir_all(&own).unwrap();
                let file = own.join("rabbitmq.conf");
                let text = format!(
                    "listeners.tcp = none\nmqtt.listeners.tcp.1 = 127.0.0.1:{port}\nmqtt.allow_anonymous = true\n\
                     cluster_formation.peer_discovery_backend = classic_config\n\
                     cluster_formation.classic_config.nodes.1 = node-0@localhost\n\
                     cluster_formation.classic_config.nodes.2 = node-1@localhost\n"
                );
                fs::write(&file, text).unwrap();
                let mut command = Command::new("/usr/lib/rabbitmq/bin/rabbitmq-server");
                command
                    .env("HOME", &home)
                    .env("ERL_EPMD_PORT", names.to_string())
                    .env("ERL_EPMD_ADDRESS", "127.0.0.1")
                    .env("RABBITMQ_NODENAME", format!("node-{number}@localhost"))
                    .env("RABBITMQ_DIST_PORT", free_port().to_string())
                    .env("RABBITMQ_CONFIG_FILE", &file)
                    .env("RABBITMQ_CONF_ENV_FILE", &empty)
                    .env("RABBITMQ_ENABLED_PLUGINS_FILE", &plugins)
                    .env("RABBITMQ_MNESIA_BASE", own.join("db"))
                    .env("RABBITMQ_LOG_BASE", own.join("log"))
                    .env("RABBITMQ_PID_FILE", own.join("pid"))
                    .env(
                        "RABBITMQ_SERVER_ADDITIONAL_ERL_ARGS",
                        "+S 1:1 +sbwt none +sbwtdcpu none +sbwtdio none",
                    );
                nodes.push(Process::start(&mut command)?);
            }
            nodes.push(daemon);
            Some(nodes)
        })
    }

    /// Two brokers `mosquitto` with a bridge that passes everything on: what others need a cluster for, for any number of topics.
    pub fn mosquitto() -> Option<Self> {
        Self::start(|folder, ports| {
            let bridge = format!(
                "connection other\naddress 127.0.0.1:{}\ntopic # both 2\ncleansession true\nnotifications false\n",
                ports[0]
            );
            let mut nodes = Vec::new();
            for (number, port) in ports.iter().enumerate() {
                let file = folder.join(format!("node-{number}.conf"));
                let text = format!(
                    "listener {port} 127.0.0.1\nallow_anonymous true\nmax_queued_messages 0\nmax_inflight_messages 0\n{}",
                    if number == 0 { "" } else { &bridge }
                );
                fs::write(&file, text).unwrap();
                nodes.push(Process::start(Command::new("mosquitto").arg("-c").arg(&file))?);
            }
            Some(nodes)
        })
    }

    /// Starts nodes until both let clients in. Ports are guessed, and another test may be faster, hence several tries.
    fn start(nodes: impl Fn(&Path, [u16; 2]) -> Option<Vec<Process>>) -> Option<Self> {
        let begun = Instant::now();
        for _ in 0..3 {
            let folder = tempfile::tempdir().unwrap();
            let ports = [free_port(), free_port()];
            let processes = nodes(folder.path(), ports)?;
            let mut this = Self {
                processes,
                ports,
                _folder: folder,
            };
            while begun.elapsed() < LIMIT && !this.processes.iter_mut().any(Process::has_ended) {
                if ports.iter().all(|port| lets_in(*port)) {
                    return Some(this);
                }
                std::thread::sleep(Duration::from_millis(50));
            }
        }
        panic!("the cluster does not start");
    }

    /// The address of a node.
    pub fn url(&self, node: usize) -> String {
        format!("mqtt://127.0.0.1:{}", self.ports[node])
    }
}

/// Whether a broker accepts a client and what it subscribes to with QoS 1: nodes that do not know each other yet refuse that.
fn lets_in(port: u16) -> bool {
    let name = format!("{:08x}", std::process::id());
    let id = &name.as_bytes()[..8];
    let mut connect = vec![0x10, 20, 0, 4, b'M', b'Q', b'T', b'T', 4, 2, 0, 30, 0, 8];
    connect.extend_from_slice(id);
    let ask = || {
        let mut socket = TcpStream::connect(("127.0.0.1", port))?;
        socket.set_read_timeout(Some(ANSWER))?;
        socket.write_all(&connect)?;
        let mut answer = [0; 4];
        socket.read_exact(&mut answer)?;
        if answer != [0x20, 2, 0, 0] {
            return Ok(false);
        }
        socket.write_all(&[0x82, 10, 0, 1, 0, 5, b'r', b'e', b'a', b'd', b'y', 1])?;
        let mut granted = [0; 5];
        socket.read_exact(&mut granted)?;
        socket.write_all(&[0xe0, 0])?;
        Ok::<_, std::io::Error>(granted == [0x90, 3, 0, 1, 1])
    };
    ask().unwrap_or(false)
}

fn only_for_owner(file: &Path) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        fs::set_permissions(file, fs::Permissions::from_mode(0o600)).unwrap();
    }
    #[cfg(not(unix))]
    let _ = file;
}
