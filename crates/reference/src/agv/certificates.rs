//! updateCertificate: a certificate with its key is fetched, file by file, looked into, and used from then on (section
//! 6.2.3.3).
//!
//! The vehicle knows one service, and fetches over TLS only. What fails leaves the certificate in use that there is.

use bytes::Bytes;

use super::Agv;
use super::action_effect::{Outcome, Problem};
use super::actions::{Action, Status};
use super::certificate_set::flaw;
use super::hook_points::Permission;

/// The one service that the vehicle has a certificate for.
const SERVICE: &str = "MQTT";

const KEY: &str = "keyDownloadLink";
const CERTIFICATE: &str = "certificateDownloadLink";
const AUTHORITY: &str = "certificateAuthorityDownloadLink";

/// The parameters that name a file, in the order in which they are fetched.
const LINKS: [&str; 3] = [KEY, CERTIFICATE, AUTHORITY];

/// The parameters of an updateCertificate action that name a file.
fn named(action: &Action) -> impl Iterator<Item = &'static str> {
    LINKS.into_iter().filter(|key| !action.text(key).is_empty())
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
        let plain = |key: &'static str| !action.text(key).starts_with("https://");
        if named(action).any(plain) && self.allows(Permission::RefusePlainLink, true) {
            return Outcome::Failed(Problem::unable(action, "a certificate is fetched over TLS only"));
        }
        if let Some(action) = self.actions.get_mut(&action.request.id) {
            action.status = Status::Running;
        }
        self.fetch_next(action)
    }

    /// Asks for the next file of an updateCertificate action, or has them all.
    fn fetch_next(&mut self, action: &Action) -> Outcome {
        let missing = |key: &&'static str| action.files.iter().all(|(had, _)| had != key);
        let wanted = |key: &&'static str| missing(key) && self.allows(Permission::FetchForCertificate(key), true);
        let Some(key) = named(action).find(wanted) else {
            return self.activated(action);
        };
        self.ask_for_file(&action.request.id, action.text(key));
        let due = self.moment() + self.config.download_timeout;
        if let Some(action) = self.actions.get_mut(&action.request.id) {
            action.awaits = Some(key);
            action.due = Some(due);
        }
        Outcome::Open
    }

    /// A file of an updateCertificate action is there.
    pub(crate) fn certificate_file_done(&mut self, id: &str, file: &Bytes) {
        let Some(action) = self.actions.get_mut(id) else { return };
        if let Some(key) = action.awaits.take() {
            action.files.push((key, file.clone()));
        }
        let action = action.clone();
        let outcome = self.fetch_next(&action);
        let outcome = self.ends(&action, outcome);
        self.conclude(id, outcome);
    }

    /// Uses what was fetched from now on, unless something is wrong with it (CERT-02, CERT-04).
    fn activated(&self, action: &Action) -> Outcome {
        let file = |wanted| {
            action
                .files
                .iter()
                .find(|(key, _)| *key == wanted)
                .map(|(_, file)| file)
        };
        let (Some(key), Some(certificate)) = (file(KEY), file(CERTIFICATE)) else {
            return Outcome::Done(None);
        };
        match flaw(key, certificate, file(AUTHORITY), self.now.utc) {
            Some(flaw) if self.allows(Permission::RefuseCertificate(flaw), true) => {
                Outcome::Failed(Problem::unable(action, flaw.text()))
            }
            _ => Outcome::Done(None),
        }
    }
}
