//! Files that are served to a device: maps, documents, and the certificates that it is given.

use serde_json::json;

use super::{Engine, EngineError, Operator, map_file};
use tck_base::pattern::Bindings;
use tck_journal::event::{Event, StepEnd};
use tck_net::bench::Offer;
use tck_net::link::Link;
use tck_suite::model::{CertificateFile, Serve};

impl<L: Link, O: Operator> Engine<L, O> {
    /// Offers a file, and binds its address.
    pub(super) async fn serve(&mut self, serve: &Serve) -> Result<StepEnd, EngineError> {
        let bindings = self
            .recorder
            .judge()
            .current()
            .map(|test| test.bindings().clone())
            .unwrap_or_default();
        let body = match serve.certificate {
            None => map_file::content(serve, &bindings, &self.map_files),
            Some(file) => self.certificate_file(file, &bindings),
        };
        let body = match body {
            Ok(body) => body,
            Err(why) => return Ok(StepEnd::Broken(why)),
        };
        // Keys are made by chance, and a run in virtual time is the same every time: nothing of them is recorded.
        let sha256 = serve.certificate.is_none().then(|| map_file::sha256(&body));
        let offer = Offer {
            name: serve.name.clone(),
            body,
            behaviour: serve.behaviour,
            secured: serve.certificate.is_some(),
        };
        let url = self.link.serve(offer).await?;
        self.note(Event::Served {
            name: serve.name.clone(),
            url: url.clone(),
            behaviour: serve.behaviour.word().to_owned(),
        })?;
        let mut served = json!({ "url": url });
        if let Some(sha256) = sha256 {
            served["sha256"] = sha256.into();
        }
        self.bind(&format!("serve.{}", serve.name), served)?;
        Ok(StepEnd::Decided)
    }

    /// A file of a certificate for the device, or why there is none.
    fn certificate_file(&mut self, file: CertificateFile, bindings: &Bindings) -> Result<bytes::Bytes, String> {
        let now = self.link.now().utc;
        let trusted = self.link.trusted();
        let test = self.recorder.judge().current().map(|test| test.test().id.clone());
        let device = bindings
            .get("device")
            .and_then(|device| device["serialNumber"].as_str());
        let of = (test.as_deref().unwrap_or_default(), device.unwrap_or_default());
        self.certificate_files.content(file, of, now, &trusted)
    }
}
