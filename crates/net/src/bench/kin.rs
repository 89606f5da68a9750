//! Whose the other end of a connection is: the program's that the run has started, or somebody else's. Linux tells it in
//! `/proc`; elsewhere nobody knows, and that is said.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use tck_journal::event::Origin;

/// What descends from the program that the run has started. Copies are the same.
#[derive(Clone, Debug, Default)]
pub struct Kin {
    /// The process that is the ancestor of all; zero as long as nothing was started.
    ancestor: Arc<AtomicU32>,
}

impl Kin {
    /// Whether this system tells whose a connection is.
    pub const TELLS: bool = cfg!(target_os = "linux");

    /// A process was started; what it starts is its kin.
    pub fn started(&self, process: u32) {
        self.ancestor.store(process, Ordering::Relaxed);
    }

    /// Whose the other end of a connection is that was accepted from `peer` at `own`. Nothing where no program was
    /// started, or the system does not tell.
    pub async fn origin(&self, peer: SocketAddr, own: SocketAddr) -> Option<Origin> {
        let ancestor = self.ancestor.load(Ordering::Relaxed);
        if ancestor == 0 || !Self::TELLS {
            return None;
        }
        let looked = tokio::task::spawn_blocking(move || origin(ancestor, peer, own));
        Some(looked.await.unwrap_or(Origin::Unseen))
    }
}

#[cfg(not(target_os = "linux"))]
fn origin(_ancestor: u32, _peer: SocketAddr, _own: SocketAddr) -> Origin {
    Origin::Unseen
}

#[cfg(target_os = "linux")]
use proc::origin;

#[cfg(target_os = "linux")]
mod proc {
    use std::collections::{BTreeMap, BTreeSet};
    use std::net::{IpAddr, SocketAddr};

    use tck_journal::event::Origin;

    /// A process: its parent, and what it is called.
    struct Process {
        parent: u32,
        name: String,
    }

    /// Whether a process has a socket.
    enum Has {
        Yes,
        No,
        /// Nobody may see what it has.
        Hidden,
    }

    pub(super) fn origin(ancestor: u32, peer: SocketAddr, own: SocketAddr) -> Origin {
        let is_here = peer.ip().to_canonical().is_loopback() || peer.ip().to_canonical() == own.ip().to_canonical();
        if !is_here {
            return Origin::Elsewhere;
        }
        let Some(inode) = socket_of(peer, own) else {
            return Origin::Unseen;
        };
        let socket = format!("socket:[{inode}]");
        let all = processes();
        let kin = kin(ancestor, &all);
        let mut hidden = false;
        for process in &kin {
            match has(*process, &socket) {
                Has::Yes => return Origin::Started { process: *process },
                Has::No => {}
                Has::Hidden => hidden = true,
            }
        }
        let others = all.iter().filter(|(process, _)| !kin.contains(process));
        for (process, about) in others {
            if matches!(has(*process, &socket), Has::Yes) {
                return Origin::Other {
                    process: Some(*process),
                    name: Some(about.name.clone()),
                };
            }
        }
        if hidden {
            return Origin::Unseen;
        }
        Origin::Other {
            process: None,
            name: None,
        }
    }

    /// The inode of the other end of a connection; nothing where no process has it any more.
    fn socket_of(peer: SocketAddr, own: SocketAddr) -> Option<u64> {
        let ends = [(peer, own), (mapped(peer), mapped(own))];
        let tables = ["/proc/net/tcp", "/proc/net/tcp6"];
        tables.iter().find_map(|table| {
            let table = std::fs::read_to_string(table).ok()?;
            ends.iter().find_map(|(peer, own)| {
                let wanted = (written(*peer), written(*own));
                let mut rows = table.lines().skip(1).map(|row| row.split_ascii_whitespace());
                rows.find_map(|mut row| {
                    let (local, remote) = (row.nth(1)?, row.next()?);
                    let inode = row.nth(6)?;
                    let is_it = local == wanted.0 && remote == wanted.1;
                    inode.parse().ok().filter(|inode| is_it && *inode != 0)
                })
            })
        })
    }

    /// An address of the fourth version as a socket of the sixth shows it.
    fn mapped(address: SocketAddr) -> SocketAddr {
        match address.ip() {
            IpAddr::V4(ip) => SocketAddr::new(ip.to_ipv6_mapped().into(), address.port()),
            IpAddr::V6(ip) => match ip.to_canonical() {
                IpAddr::V4(ip) => SocketAddr::new(ip.into(), address.port()),
                IpAddr::V6(_) => address,
            },
        }
    }

    /// An address as the tables of the system write it: words of four bytes as this machine reads them.
    fn written(address: SocketAddr) -> String {
        let bytes = match address.ip() {
            IpAddr::V4(ip) => ip.octets().to_vec(),
            IpAddr::V6(ip) => ip.octets().to_vec(),
        };
        let words = bytes.chunks_exact(4).map(|word| {
            let word = word.try_into().map_or(0, u32::from_ne_bytes);
            format!("{word:08X}")
        });
        format!("{}:{:04X}", words.collect::<String>(), address.port())
    }

    fn processes() -> BTreeMap<u32, Process> {
        let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
        let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
        numbers
            .filter_map(|number| {
                let stat = std::fs::read(format!("/proc/{number}/stat")).ok()?;
                let stat = String::from_utf8_lossy(&stat).into_owned();
                // Its name may hold anything, and stands in brackets.
                let (head, rest) = stat.rsplit_once(')')?;
                let parent = rest.split_ascii_whitespace().nth(1)?.parse().ok()?;
                let (_, name) = head.split_once('(')?;
                let name = name.to_owned();
                Some((number, Process { parent, name }))
            })
            .collect()
    }

    /// A process and all that descend from it.
    fn kin(ancestor: u32, all: &BTreeMap<u32, Process>) -> BTreeSet<u32> {
        let mut found = BTreeSet::from([ancestor]);
        loop {
            let before = found.len();
            let children = all.iter().filter(|(_, process)| found.contains(&process.parent));
            let children: Vec<u32> = children.map(|(number, _)| *number).collect();
            found.extend(children);
            if found.len() == before {
                return found;
            }
        }
    }

    fn has(process: u32, socket: &str) -> Has {
        let Ok(open) = std::fs::read_dir(format!("/proc/{process}/fd")) else {
            return Has::Hidden;
        };
        let mut links = open.flatten().filter_map(|entry| std::fs::read_link(entry.path()).ok());
        match links.any(|link| link.as_os_str() == socket) {
            true => Has::Yes,
            false => Has::No,
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn addresses_are_written_as_the_system_writes_them() {
            if cfg!(target_endian = "little") {
                assert_eq!(written("127.0.0.1:1883".parse().unwrap()), "0100007F:075B");
                assert_eq!(
                    written("[::ffff:127.0.0.1]:1883".parse().unwrap()),
                    "0000000000000000FFFF00000100007F:075B"
                );
            }
        }

        #[test]
        fn what_a_process_starts_is_its_kin_and_nothing_else() {
            let process = |parent| Process {
                parent,
                name: String::new(),
            };
            let all = BTreeMap::from([
                (1, process(0)),
                (5, process(1)),
                (6, process(5)),
                (7, process(6)),
                (8, process(1)),
            ]);
            assert_eq!(kin(5, &all), BTreeSet::from([5, 6, 7]));
        }

        #[test]
        fn a_connection_of_this_process_is_its_own_and_a_strangers_to_another() {
            let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
            let client = std::net::TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let (server, peer) = listener.accept().unwrap();
            let own = server.local_addr().unwrap();
            let process = std::process::id();
            assert_eq!(origin(process, peer, own), Origin::Started { process });
            let mut other = std::process::Command::new("sleep").arg("30").spawn().unwrap();
            let of_other = origin(other.id(), peer, own);
            let _ = other.kill();
            let _ = other.wait();
            assert!(
                matches!(of_other, Origin::Other { process: Some(found), .. } if found == process),
                "{of_other:?}"
            );
            drop(client);
            assert_eq!(origin(process, peer, own), Origin::Unseen);
            let far = "192.0.2.7:5000".parse().unwrap();
            assert_eq!(origin(process, far, own), Origin::Elsewhere);
        }
    }
}
