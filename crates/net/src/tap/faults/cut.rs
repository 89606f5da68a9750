//! `cut`: open connections end, by RST or FIN, and none is let in until `restore`.

use super::Change;
use super::refuse::Refuse;

pub(super) fn begin(refuse: &mut Refuse, reset: bool) -> Change {
    refuse.begin();
    Change::Cut { reset }
}

/// Makes `socket` end with RST instead of FIN when it is closed.
///
/// A lingering time of zero throws away what was not sent yet, which is what a cable pulled out does.
pub fn abort(socket: &tokio::net::TcpStream) {
    if let Err(error) = socket.set_zero_linger() {
        tracing::debug!(%error, "a socket would not be set to end with RST");
    }
}

#[cfg(test)]
mod tests {
    use crate::tap::faults::{Change, Faults};
    use tck_journal::event::LinkFault;

    #[test]
    fn cut_ends_connections_and_keeps_new_ones_out_until_restore() {
        let mut faults = Faults::default();
        assert_eq!(
            faults.apply(&LinkFault::Cut { reset: true }),
            Change::Cut { reset: true }
        );
        assert!(!faults.admits());
        faults.apply(&LinkFault::Restore);
        assert!(faults.admits());
    }
}
