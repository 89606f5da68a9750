//! updateCertificate: a certificate with its key is fetched, file by file, and used from then on (section 6.2.3.3).
//!
//! The vehicle knows one service, and fetches over TLS only. What fails leaves the certificate in use that there is.

use super::Agv;
use super::action_effect::{Outcome, Problem};
use super::actions::{Action, Status};
use super::hook_points::{Event, Permission};

/// The one service that the vehicle has a certificate for.
const SERVICE: &str = "MQTT";

/// The parameters that name a file, in the order in which they are fetched.
const LINKS: [&str; 3] = [
    "keyDownloadLink",
    "certificateDownloadLink",
    "certificateAuthorityDownloadLink",
];

/// How a key or a certificate begins, in the form in which they are mostly stored.
const PEM: &[u8] = b"-----BEGIN ";

/// Whether a file looks like a key or a certificate.
fn is_pem(file: &[u8]) -> bool {
    file.windows(PEM.len()).any(|part| part == PEM)
}

/// The links of an updateCertificate action.
fn links(action: &Action) -> Vec<String> {
    let links = LINKS.iter().map(|key| action.text(key).to_owned());
    links.filter(|link| !link.is_empty()).collect()
}

impl Agv {
    /// updateCertificate begins: its first file is asked for.
    pub(crate) fn update_certificate(&mut self, action: &Action) -> Outcome {
        if action.text("service") != SERVICE && self.allows(Permission::RefuseService, true) {
            return Outcome::Failed(Problem::unable(
                action,
                "the vehicle has no certificate for this service",
            ));
        }
        let links = links(action);
        let plain = |link: &String| !link.starts_with("https://");
        if links.iter().any(plain) && self.allows(Permission::RefusePlainLink, true) {
            return Outcome::Failed(Problem::unable(action, "a certificate is fetched over TLS only"));
        }
        if let Some(action) = self.actions.get_mut(&action.request.id) {
            action.status = Status::Running;
        }
        self.fetch_next(action, 0)
    }

    /// Asks for the next file of an updateCertificate action, or has them all.
    fn fetch_next(&mut self, action: &Action, had: usize) -> Outcome {
        let links = links(action);
        let Some(url) = links.get(had) else {
            return Outcome::Done(None);
        };
        self.ask_for_file(&action.request.id, url);
        let due = self.moment() + self.config.download_timeout;
        if let Some(action) = self.actions.get_mut(&action.request.id) {
            action.files = had + 1;
            action.due = Some(due);
        }
        Outcome::Open
    }

    /// A file of an updateCertificate action is there.
    pub(crate) fn certificate_file_done(&mut self, action: &Action, file: &[u8]) {
        self.happens(Event::CertificateFile(is_pem(file)));
        let outcome = self.fetch_next(action, action.files);
        let outcome = self.ends(action, outcome);
        self.conclude(&action.request.id, outcome);
    }
}
