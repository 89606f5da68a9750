//! TLS towards the device and towards an external broker, from PEM files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{ClientConfig, RootCertStore, ServerConfig};

use crate::bench::LinkError;

/// A certificate that is shown: by the tap to the device, or to a broker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// PEM file with the certificate chain.
    pub certificate: PathBuf,
    /// PEM file with the private key.
    pub key: PathBuf,
}

/// Configuration of the side towards the device.
pub(crate) fn server(files: &TlsFiles) -> Result<Arc<ServerConfig>, LinkError> {
    let chain = certificates(&files.certificate)?;
    let key = PrivateKeyDer::from_pem_file(&files.key).map_err(|error| unreadable(&files.key, &error))?;
    let config = ServerConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
        .map_err(|error| LinkError::Setup(format!("certificate and key for the device do not work: {error}")))?;
    Ok(Arc::new(config))
}

/// Configuration of the side towards the broker; trusts `authority`, or what the system trusts, and shows `identity` where it
/// is asked for one.
pub(crate) fn client(authority: Option<&Path>, identity: Option<&TlsFiles>) -> Result<Arc<ClientConfig>, LinkError> {
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

pub(super) fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, LinkError> {
    let all = CertificateDer::pem_file_iter(path).map_err(|error| unreadable(path, &error))?;
    let all: Vec<_> = all
        .collect::<Result<_, _>>()
        .map_err(|error| unreadable(path, &error))?;
    if all.is_empty() {
        return Err(LinkError::Setup(format!("{} has no certificate in it", path.display())));
    }
    Ok(all)
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
