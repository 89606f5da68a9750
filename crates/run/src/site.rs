//! The bench of a site, as a profile describes it: broker, certificates, secrets, and who can reach what.

use std::net::IpAddr;
use std::path::PathBuf;

use tck_base::diagnostic::Diagnostic;
use tck_journal::Reason;
use tck_net::bench::endpoint::{Access, Credentials};
use tck_net::bench::own::OwnNames;
use tck_net::bench::tls::TlsFiles;
use tck_net::link::mqtt::{BenchOptions, BrokerChoice};
use tck_profile::{Effective, Password, Profile, Secrets, Surroundings};

/// The certificates and keys that a profile names have to be there.
pub(super) fn certificates(effective: &Effective) -> Result<(), Vec<Diagnostic>> {
    let bench = &effective.profile.bench;
    let files = [
        ("bench.tls-ca", &bench.tls_ca),
        ("bench.tls-cert", &bench.tls_cert),
        ("bench.tls-key", &bench.tls_key),
        ("bench.client-cert", &bench.client_cert),
        ("bench.client-key", &bench.client_key),
    ];
    let unreadable = files.into_iter().filter_map(|(setting, file)| {
        let file = file.as_ref()?;
        let error = std::fs::File::open(file).err()?;
        let title = format!("the file {} cannot be read: {error}", file.display());
        Some(effective.complain(setting, "unreadable", title, "named here"))
    });
    let unreadable: Vec<Diagnostic> = unreadable.collect();
    if unreadable.is_empty() { Ok(()) } else { Err(unreadable) }
}

/// Puts the secrets of the hooks into them. Gives all that the run knows and does not tell.
pub(super) fn resolve(
    profile: &mut Profile,
    options: &BenchOptions,
    surroundings: &Surroundings,
) -> Result<Secrets, Vec<Diagnostic>> {
    let mut wrong = Vec::new();
    let mut secrets = Vec::new();
    for hook in profile.hooks.values_mut() {
        match hook.action.resolved(surroundings) {
            Ok(resolved) => hook.action = resolved,
            Err(error) => wrong.push(Diagnostic::new(
                "secret",
                hook.span.clone(),
                format!("a header of hook `{}` cannot be made: {error}", hook.name),
                "this hook",
            )),
        }
        secrets.extend(hook.action.secrets());
    }
    if let BrokerChoice::External {
        access: Access {
            credentials: Some(credentials),
            ..
        },
        ..
    } = &options.broker
    {
        secrets.push(Password::new(&credentials.password));
    }
    if wrong.is_empty() {
        Ok(secrets.into_iter().collect())
    } else {
        Err(wrong)
    }
}

/// Who publishes where.
pub(super) struct Topics {
    pub(super) device: Vec<String>,
    pub(super) harness: Vec<String>,
}

/// A certificate with its key.
fn shown(certificate: Option<&PathBuf>, key: Option<&PathBuf>) -> Option<TlsFiles> {
    Some(TlsFiles {
        certificate: certificate?.clone(),
        key: key?.clone(),
    })
}

/// The bench that a profile describes.
pub(super) fn bench_of(
    profile: &Profile,
    topics: Topics,
    surroundings: &Surroundings,
) -> Result<BenchOptions, Vec<Diagnostic>> {
    let bench = &profile.bench;
    let password = bench.password.password(surroundings);
    let password = password.map_err(|error| vec![Diagnostic::whole("password", error.to_string())])?;
    let credentials = bench.username.clone().map(|username| Credentials {
        username,
        password: password
            .map(|password| password.reveal().to_owned())
            .unwrap_or_default(),
    });
    Ok(BenchOptions {
        listen: bench.listen.clone(),
        broker: match &bench.broker {
            None => BrokerChoice::Embedded,
            Some(url) => BrokerChoice::External {
                url: url.clone(),
                access: Access {
                    authority: bench.tls_ca.clone(),
                    identity: shown(bench.client_cert.as_ref(), bench.client_key.as_ref()),
                    credentials,
                    client_id: None,
                },
            },
        },
        cluster: bench.cluster.clone(),
        authority: bench.tls_ca.clone(),
        tap: bench.tap,
        tls: shown(bench.tls_cert.as_ref(), bench.tls_key.as_ref()),
        maps_listen: bench.maps_listen.clone(),
        maps_host: bench.maps_host.clone(),
        own: OwnNames {
            topics: bench.own_topics.clone(),
            client_id: bench.client_id.clone(),
        },
        harness_topics: topics.harness,
        ..BenchOptions::loopback(topics.device)
    })
}

/// Whether a device that connects to this bench can fetch a file from its map server; `Err` says why not. One that the
/// harness starts runs on this machine.
pub(super) fn reach(options: &BenchOptions, starts_device: bool) -> Result<(), Reason> {
    let host = options
        .maps_host
        .as_deref()
        .unwrap_or_else(|| host_of(&options.maps_listen));
    if is_any(host) {
        return Err(Reason::MapServerUnreachable { host: host.to_owned() });
    }
    let meets_at = match (&options.broker, options.tap) {
        (BrokerChoice::External { url, .. }, false) => {
            let (_, rest) = url.split_once("://").unwrap_or(("", url));
            host_of(rest)
        }
        _ => host_of(&options.listen),
    };
    if is_this_machine(host) && !is_this_machine(meets_at) && !starts_device {
        return Err(Reason::MapServerElsewhere {
            host: host.to_owned(),
            device: meets_at.to_owned(),
        });
    }
    Ok(())
}

/// Whether files are served over TLS; `Err` says why not. A device trusts the certificate that the tap shows it.
pub(super) fn secured_files(options: &BenchOptions) -> Result<(), Reason> {
    match options.tls {
        Some(_) => Ok(()),
        None => Err(Reason::NoSecuredFiles),
    }
}

fn host_of(address: &str) -> &str {
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    host.trim_start_matches('[').trim_end_matches(']')
}

fn is_any(host: &str) -> bool {
    host.parse::<IpAddr>().is_ok_and(|address| address.is_unspecified())
}

fn is_this_machine(host: &str) -> bool {
    host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bench(listen: &str, maps_listen: &str, maps_host: Option<&str>) -> BenchOptions {
        BenchOptions {
            listen: listen.to_owned(),
            maps_listen: maps_listen.to_owned(),
            maps_host: maps_host.map(str::to_owned),
            ..BenchOptions::loopback(Vec::new())
        }
    }

    #[test]
    fn a_device_elsewhere_reaches_no_map_on_loopback() {
        let elsewhere = |maps_listen, maps_host| reach(&bench("192.168.1.20:1883", maps_listen, maps_host), false);
        assert!(elsewhere("127.0.0.1:0", None).is_err());
        assert!(elsewhere("0.0.0.0:0", None).is_err());
        assert!(elsewhere("0.0.0.0:0", Some("localhost")).is_err());
        assert!(elsewhere("[::]:0", None).is_err());
        assert!(elsewhere("0.0.0.0:0", Some("192.168.1.20")).is_ok());
        assert!(elsewhere("192.168.1.20:0", None).is_ok());
    }

    #[test]
    fn a_device_on_this_machine_reaches_them() {
        assert!(reach(&bench("127.0.0.1:1883", "127.0.0.1:0", None), false).is_ok());
        assert!(reach(&bench("192.168.1.20:1883", "127.0.0.1:0", None), true).is_ok());
        assert!(reach(&bench("[::1]:1883", "[::1]:0", None), false).is_ok());
    }

    #[test]
    fn without_a_tap_it_is_where_the_broker_is() {
        let mut bench = bench("127.0.0.1:1883", "127.0.0.1:0", None);
        bench.tap = false;
        bench.broker = BrokerChoice::External {
            url: "mqtt://192.168.1.10:1883".to_owned(),
            access: Access::default(),
        };
        assert!(reach(&bench, false).is_err());
    }
}
