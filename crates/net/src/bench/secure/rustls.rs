//! TLS by rustls, and in plain words why a broker cannot be reached over it.

use std::io;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use tokio::net::TcpStream;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use tokio_rustls::rustls::{CertificateError, ClientConfig, Error as TlsError, RootCertStore, ServerConfig};
use tokio_rustls::{TlsAcceptor, TlsConnector, server};
use ureq::config::ConfigBuilder;
use ureq::tls::{Certificate, RootCerts, TlsConfig, TlsProvider};
use ureq::typestate::AgentScope;

use crate::bench::LinkError;
use crate::bench::stream::{Socket, Stream};
use crate::bench::tls::TlsFiles;

/// What the system trusts; reading it takes a while, and it does not change.
static SYSTEM: OnceLock<Vec<Certificate<'static>>> = OnceLock::new();

/// TLS towards a broker.
#[derive(Clone, Debug)]
pub struct TlsClient(Arc<ClientConfig>);

/// TLS towards devices.
#[derive(Clone)]
pub struct TlsServer(TlsAcceptor);

impl Socket for server::TlsStream<TcpStream> {
    fn tcp(&self) -> &TcpStream {
        self.get_ref().0
    }
}

impl TlsClient {
    /// Trusts `authority`, or what the system trusts, and shows `identity` where it is asked for one.
    pub(crate) fn new(authority: Option<&Path>, identity: Option<&TlsFiles>) -> Result<Self, LinkError> {
        client(authority, identity).map(Self)
    }

    /// Secures a connection to the broker of this name; `plain` is the scheme of its URL where it speaks no TLS.
    ///
    /// # Errors
    /// Why it is not secured, as the end of a sentence about the broker.
    pub(crate) async fn secure(&self, socket: TcpStream, host: &str, plain: &str) -> Result<Box<dyn Stream>, String> {
        let name = ServerName::try_from(host.to_owned());
        let name = name.map_err(|_| format!("no certificate can be for the name `{host}`"))?;
        let secured = TlsConnector::from(self.0.clone()).connect(name, socket).await;
        Ok(Box::new(
            secured.map_err(|error| handshake_failed(&error, host, plain))?,
        ))
    }
}

impl TlsServer {
    /// Shows this certificate.
    ///
    /// # Errors
    /// [`LinkError::Setup`] when certificate or key cannot be read, or do not belong together.
    pub fn new(files: &TlsFiles) -> Result<Self, LinkError> {
        server(files).map(|config| Self(config.into()))
    }

    /// Secures a connection of a device.
    pub(crate) async fn accept(&self, socket: TcpStream) -> io::Result<Box<dyn Socket>> {
        Ok(Box::new(self.0.accept(socket).await?))
    }
}

/// Lets HTTP requests trust what the system trusts, and `authority`.
pub(crate) fn trusting(
    config: ConfigBuilder<AgentScope>,
    authority: Option<&Path>,
) -> Result<ConfigBuilder<AgentScope>, LinkError> {
    let mut roots = match authority {
        Some(path) => certificates(path)?
            .iter()
            .map(|certificate| Certificate::from_der(certificate).to_owned())
            .collect(),
        None => Vec::new(),
    };
    roots.extend_from_slice(SYSTEM.get_or_init(|| {
        let system = rustls_native_certs::load_native_certs().certs;
        system
            .iter()
            .map(|certificate| Certificate::from_der(certificate).to_owned())
            .collect()
    }));
    let tls = TlsConfig::builder()
        .provider(TlsProvider::Rustls)
        .root_certs(RootCerts::new_with_certs(&roots))
        .unversioned_rustls_crypto_provider(Arc::new(ring::default_provider()))
        .build();
    Ok(config.tls_config(tls))
}

fn server(files: &TlsFiles) -> Result<Arc<ServerConfig>, LinkError> {
    let chain = certificates(&files.certificate)?;
    let key = PrivateKeyDer::from_pem_file(&files.key).map_err(|error| unreadable(&files.key, &error))?;
    let config = ServerConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
        .map_err(|error| LinkError::Setup(format!("certificate and key for the device do not work: {error}")))?;
    Ok(Arc::new(config))
}

fn client(authority: Option<&Path>, identity: Option<&TlsFiles>) -> Result<Arc<ClientConfig>, LinkError> {
    let mut roots = RootCertStore::empty();
    match authority {
        Some(path) => {
            for certificate in certificates(path)? {
                roots.add(certificate).map_err(|error| unreadable(path, &error))?;
            }
        }
        None => {
            roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
        }
    }
    if roots.is_empty() {
        return Err(LinkError::Setup(
            "there is no certificate authority to check the broker's certificate against".to_owned(),
        ));
    }
    let config = ClientConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .map_err(|error| LinkError::Setup(error.to_string()))?
        .with_root_certificates(roots);
    let config = match identity {
        None => config.with_no_client_auth(),
        Some(files) => {
            let key = PrivateKeyDer::from_pem_file(&files.key).map_err(|error| unreadable(&files.key, &error))?;
            let config = config.with_client_auth_cert(certificates(&files.certificate)?, key);
            config
                .map_err(|error| LinkError::Setup(format!("certificate and key for the broker do not work: {error}")))?
        }
    };
    Ok(Arc::new(config))
}

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, LinkError> {
    let all = CertificateDer::pem_file_iter(path).map_err(|error| unreadable(path, &error))?;
    let all: Vec<_> = all
        .collect::<Result<_, _>>()
        .map_err(|error| unreadable(path, &error))?;
    if all.is_empty() {
        return Err(LinkError::Setup(format!("{} has no certificate in it", path.display())));
    }
    Ok(all)
}

fn handshake_failed(error: &io::Error, host: &str, plain: &str) -> String {
    let cause = error.get_ref().and_then(|cause| cause.downcast_ref::<TlsError>());
    match cause {
        Some(TlsError::InvalidCertificate(wrong)) => certificate_refused(wrong, host),
        Some(TlsError::InvalidMessage(_)) => format!("it does not speak TLS there; without TLS it is {plain}://"),
        Some(TlsError::AlertReceived(alert)) => {
            format!("it refuses the TLS connection ({alert:?}); it may ask for a certificate of the client")
        }
        _ => format!("it ends the connection during the TLS handshake ({error}); without TLS it is {plain}://"),
    }
}

fn certificate_refused(wrong: &CertificateError, host: &str) -> String {
    match wrong {
        CertificateError::UnknownIssuer => {
            "its certificate is not trusted, because the authority that signed it is not \
                                            known (UnknownIssuer); `tls-ca` names a PEM file with that authority"
                .to_owned()
        }
        CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => format!(
            "its certificate is for another name than `{host}` ({wrong}); the URL has to name the broker as its certificate does"
        ),
        CertificateError::Expired | CertificateError::ExpiredContext { .. } => {
            format!("its certificate has expired ({wrong})")
        }
        other => format!("its certificate is not accepted ({other})"),
    }
}

fn unreadable(path: &Path, error: &dyn std::fmt::Display) -> LinkError {
    LinkError::Setup(format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_certificate_is_named() {
        let error = server(&TlsFiles {
            certificate: "no/such.pem".into(),
            key: "no/such.key".into(),
        })
        .unwrap_err();
        assert!(error.to_string().contains("no/such.pem"), "{error}");
    }

    #[test]
    fn a_file_without_a_certificate_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(
            client(Some(file.path()), None)
                .unwrap_err()
                .to_string()
                .contains("no certificate")
        );
    }
}
