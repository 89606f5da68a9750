//! Opening a port, and what to do when that fails.

use tokio::net::TcpListener;

use super::LinkError;

/// Opens a port; a port that is taken gets a text that says what to do.
pub async fn listen_on(address: &str) -> Result<TcpListener, LinkError> {
    TcpListener::bind(address)
        .await
        .map_err(|error| cannot_listen(address, &error))
}

/// Why a port cannot be opened, in words that say what to do.
pub(crate) fn cannot_listen(address: &str, error: &std::io::Error) -> LinkError {
    let reason = match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            "another program is using this port already; stop it or listen on another port".to_owned()
        }
        std::io::ErrorKind::PermissionDenied => "the system does not allow this port; choose one above 1023".to_owned(),
        std::io::ErrorKind::AddrNotAvailable => "this machine has no such address".to_owned(),
        _ => error.to_string(),
    };
    LinkError::Listen {
        address: address.to_owned(),
        reason,
    }
}
