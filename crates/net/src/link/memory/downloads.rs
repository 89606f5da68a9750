//! Map files on the in-memory bus: what the HTTP map server does, in virtual time.

use std::time::Duration;

use super::{MemoryLink, Task};
use crate::bench::Offer;
use crate::maps;
use tck_base::device::Download;
use tck_journal::ServeBehaviour;
use tck_journal::event::{Direction, Event, Source};

const BASE: &str = "http://maps.invalid";
const SECURED: &str = "https://maps.invalid";

impl MemoryLink {
    pub(super) fn offer(&mut self, offer: Offer) -> String {
        let base = if offer.secured { SECURED } else { BASE };
        let url = format!("{base}{}", maps::path_of(&offer.name));
        self.offers.insert(url.clone(), offer);
        url
    }

    pub(super) fn fetch(&mut self, peer: usize, token: u64, url: &str) {
        let step = 2 * self.options.latency;
        let path = url.strip_prefix(BASE).or_else(|| url.strip_prefix(SECURED));
        let Some(offer) = self.offers.get(url).cloned() else {
            if let Some(path) = path {
                self.fetched(step / 2, "", path, Some(404), "done");
                self.download(step, peer, token, Download::Failed("the server answers 404".to_owned()));
            } else {
                self.download(step, peer, token, Download::Failed(format!("{url} cannot be reached")));
            }
            return;
        };
        let path = path.unwrap_or(url);
        let name = offer.name.as_str();
        let failed = |text: &str| Download::Failed(text.to_owned());
        match offer.behaviour {
            ServeBehaviour::Well | ServeBehaviour::WrongBytes | ServeBehaviour::Slow => {
                let wrong = offer.behaviour == ServeBehaviour::WrongBytes;
                let body = if wrong {
                    maps::wrong_bytes(&offer.body)
                } else {
                    offer.body.clone()
                };
                let slow = offer.behaviour == ServeBehaviour::Slow;
                let time = if slow { maps::SLOW_TRANSFER } else { step };
                self.fetched(step / 2, name, path, Some(200), "begun");
                self.download(step, peer, token, Download::Begun);
                self.fetched(step / 2 + time, name, path, Some(200), "done");
                self.download(step + time, peer, token, Download::Done(body));
            }
            ServeBehaviour::NotFound => {
                self.fetched(step / 2, name, path, Some(404), "done");
                self.download(step, peer, token, failed("the server answers 404"));
            }
            ServeBehaviour::Stall => {
                self.fetched(step / 2, name, path, None, "begun");
                self.download(maps::FETCH_TIMEOUT, peer, token, failed("the server says nothing"));
                self.fetched(maps::FETCH_TIMEOUT + step / 2, name, path, None, "cut");
            }
            ServeBehaviour::Cut => {
                self.fetched(step / 2, name, path, Some(200), "begun");
                self.download(step, peer, token, Download::Begun);
                self.fetched(3 * step / 2, name, path, Some(200), "cut");
                self.download(
                    2 * step,
                    peer,
                    token,
                    failed("the connection broke off in the middle of the file"),
                );
            }
            ServeBehaviour::Unreachable => self.download(step, peer, token, failed("the connection is refused")),
        }
    }

    fn fetched(&mut self, delay: Duration, name: &str, path: &str, status: Option<u16>, phase: &str) {
        let event = Event::Fetched {
            name: name.to_owned(),
            request: format!("GET {path}"),
            status,
            phase: phase.to_owned(),
        };
        self.after(delay, Task::Report(Source::Maps, Some(Direction::FromDevice), event));
    }

    fn download(&mut self, delay: Duration, peer: usize, token: u64, progress: Download) {
        self.after(delay, Task::Download(peer, token, progress));
    }
}
