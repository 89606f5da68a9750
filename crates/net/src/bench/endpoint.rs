//! Where a broker is and how to get in.

use std::path::PathBuf;

use crate::bench::LinkError;
use crate::bench::secure::TlsClient;
use crate::bench::tls::TlsFiles;
use tck_profile::Secrets;

/// The path of a WebSocket unless said, as most brokers have it.
const USUAL_PATH: &str = "/mqtt";

/// User name and password for a broker.
#[derive(Clone, PartialEq, Eq)]
pub struct Credentials {
    /// User name.
    pub username: String,
    /// Password; never shown.
    pub password: String,
}

impl std::fmt::Debug for Credentials {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Credentials")
            .field("username", &self.username)
            .finish_non_exhaustive()
    }
}

/// How to get in at a broker.
#[derive(Clone, Debug, Default)]
pub struct Access {
    /// PEM file to check its certificate against, instead of what the system trusts.
    pub authority: Option<PathBuf>,
    /// The certificate that is shown to a broker with TLS that asks for one.
    pub identity: Option<TlsFiles>,
    /// How to log in.
    pub credentials: Option<Credentials>,
    /// The client id of whoever has one connection there; made up unless the broker prescribes one.
    pub client_id: Option<String>,
}

/// A broker.
#[derive(Clone, Debug)]
pub struct Endpoint {
    /// Host name or address.
    pub host: String,
    /// Port.
    pub port: u16,
    /// Set for TLS.
    pub tls: Option<TlsClient>,
    /// Set for WebSocket: the path, with the query behind it, which may hold a token.
    pub websocket: Option<String>,
    /// PEM file with the authority that is trusted there, and where files are fetched from.
    pub authority: Option<PathBuf>,
    /// How to log in.
    pub credentials: Option<Credentials>,
    /// The client id of whoever has one connection there, where it is prescribed.
    pub client_id: Option<String>,
}

impl Endpoint {
    /// A broker without TLS and without credentials.
    #[must_use]
    pub fn plain(address: std::net::SocketAddr) -> Self {
        Self {
            host: address.ip().to_string(),
            port: address.port(),
            tls: None,
            websocket: None,
            authority: None,
            credentials: None,
            client_id: None,
        }
    }

    /// Reads `mqtt://host:port`, `mqtts://host:port`, `ws://host:port/path`, `wss://host:port/path` or `host:port`; port
    /// and path may be left out.
    ///
    /// # Errors
    /// [`LinkError::Setup`] when the address cannot be read or the certificates do not work.
    pub fn parse(url: &str, access: &Access) -> Result<Self, LinkError> {
        let wrong = |what: &str| {
            let shown = Secrets::default().out_of(url);
            LinkError::Setup(format!("`{shown}` is not a broker: {what}"))
        };
        let (secure, web, rest) = match url.split_once("://") {
            None | Some(("mqtt" | "tcp", _)) => (false, false, url.rsplit("://").next().unwrap_or(url)),
            Some(("mqtts" | "ssl" | "tls", rest)) => (true, false, rest),
            Some(("ws", rest)) => (false, true, rest),
            Some(("wss", rest)) => (true, true, rest),
            Some((scheme, _)) => {
                let what = format!("`{scheme}` is not supported, use mqtt://, mqtts://, ws:// or wss://");
                return Err(wrong(&what));
            }
        };
        let (rest, path) = match rest.find('/').filter(|_| web) {
            Some(slash) if slash + 1 < rest.len() => rest.split_at(slash),
            _ => (rest, USUAL_PATH),
        };
        let rest = rest.strip_suffix('/').unwrap_or(rest);
        if rest.contains(['@', '/', '?']) {
            return Err(wrong(
                "only host and port belong there; user and password are given apart",
            ));
        }
        let usual_port = match (web, secure) {
            (false, false) => 1883,
            (false, true) => 8883,
            (true, false) => 80,
            (true, true) => 443,
        };
        let (host, port) = match rest.rsplit_once(':') {
            Some((host, port)) if !host.ends_with(':') && (!host.contains(':') || host.ends_with(']')) => (
                host,
                port.parse()
                    .map_err(|_| wrong("the port is not a number up to 65535"))?,
            ),
            _ => (rest, usual_port),
        };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        if host.is_empty() {
            return Err(wrong("there is no host"));
        }
        Ok(Self {
            host: host.to_owned(),
            port,
            tls: if secure {
                Some(TlsClient::new(access.authority.as_deref(), access.identity.as_ref())?)
            } else {
                None
            },
            websocket: web.then(|| path.to_owned()),
            authority: access.authority.clone(),
            credentials: access.credentials.clone(),
            client_id: access.client_id.clone(),
        })
    }

    /// The broker as messages name it: how it is reached and where, without the query of the path, which may hold a token.
    #[must_use]
    pub fn url(&self) -> String {
        let scheme = match (self.websocket.is_some(), self.tls.is_some()) {
            (false, false) => "mqtt",
            (false, true) => "mqtts",
            (true, false) => "ws",
            (true, true) => "wss",
        };
        // The query may hold a token.
        let path = self.websocket.as_deref().unwrap_or_default();
        let path = path.split('?').next().unwrap_or_default();
        format!("{scheme}://{}{path}", self.address())
    }

    /// `host:port`.
    #[must_use]
    pub fn address(&self) -> String {
        if self.host.contains(':') {
            format!("[{}]:{}", self.host, self.port)
        } else {
            format!("{}:{}", self.host, self.port)
        }
    }

    /// The error that this broker is not there.
    pub fn lost(&self, reason: impl Into<String>) -> LinkError {
        LinkError::Broker {
            broker: self.url(),
            reason: reason.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_with_and_without_scheme_and_port() {
        for (url, host, port) in [
            ("mqtt://broker.local:1884", "broker.local", 1884),
            ("mqtt://broker.local/", "broker.local", 1883),
            ("10.0.0.7", "10.0.0.7", 1883),
            ("10.0.0.7:99", "10.0.0.7", 99),
            ("mqtt://[::1]:1885", "::1", 1885),
            ("::1", "::1", 1883),
        ] {
            let endpoint = Endpoint::parse(url, &Access::default()).unwrap();
            assert_eq!((endpoint.host.as_str(), endpoint.port), (host, port), "{url}");
        }
    }

    #[test]
    fn a_websocket_has_a_path() {
        let read = |url| {
            let endpoint = Endpoint::parse(url, &Access::default()).unwrap();
            (endpoint.address(), endpoint.websocket.clone().unwrap())
        };
        let expected = |address: &str, path: &str| (address.to_owned(), path.to_owned());
        assert_eq!(read("ws://broker.local"), expected("broker.local:80", "/mqtt"));
        assert_eq!(read("ws://broker.local:9001/"), expected("broker.local:9001", "/mqtt"));
        assert_eq!(
            read("ws://[::1]:9001/a/b?token=c"),
            expected("[::1]:9001", "/a/b?token=c")
        );
        let shown = Endpoint::parse("ws://[::1]:9001/a/b?token=c", &Access::default())
            .unwrap()
            .url();
        assert_eq!(shown, "ws://[::1]:9001/a/b");
    }

    #[test]
    fn what_is_not_a_broker_is_refused_with_a_reason() {
        for (url, reason) in [
            ("http://x", "http"),
            ("mqtt://", "no host"),
            ("mqtt://x:99999", "port"),
            ("mqtt://user:secret@x", "given apart"),
        ] {
            let error = Endpoint::parse(url, &Access::default()).unwrap_err().to_string();
            assert!(error.contains(reason) && !error.contains("secret"), "{error}");
        }
    }

    #[test]
    fn a_password_is_never_shown() {
        let credentials = Credentials {
            username: "u".to_owned(),
            password: "hunter2".to_owned(),
        };
        assert!(!format!("{credentials:?}").contains("hunter2"));
    }
}
