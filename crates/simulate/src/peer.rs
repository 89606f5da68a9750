//! Plugs a reference device into the in-memory bus, which must not know reference devices itself.

use bytes::Bytes;

use tck_base::clock::{Moment, Stamp};
use tck_net::bench::Outgoing;
use tck_net::link::memory::{Peer, PeerConnect, PeerDownload, PeerInput, PeerOutput};
use tck_reference::{Device, Download, Input, Output, Publication};

/// A reference device as a peer of the bus.
#[derive(Debug)]
pub struct DevicePeer<D>(pub D);

impl<D: Device> Peer for DevicePeer<D> {
    fn connect(&mut self, now: Stamp) -> PeerConnect {
        let options = self.0.connect_options(now);
        PeerConnect {
            level: options.level,
            client_id: options.client_id,
            keep_alive: options.keep_alive,
            clean_session: options.clean_session,
            will: options.will.map(outgoing),
            subscriptions: options.subscriptions,
        }
    }

    fn handle(&mut self, now: Stamp, input: PeerInput, out: &mut Vec<PeerOutput>) {
        let input = match input {
            PeerInput::Connected => Input::Connected,
            PeerInput::ConnectionLost => Input::ConnectionLost,
            PeerInput::Message { topic, payload } => Input::Message { topic, payload },
            PeerInput::Time => Input::Time,
            PeerInput::Download { token, progress } => Input::Download {
                token,
                progress: match progress {
                    PeerDownload::Begun => Download::Begun,
                    PeerDownload::Done(body) => Download::Done(body),
                    PeerDownload::Failed(reason) => Download::Failed(reason),
                },
            },
            PeerInput::Command(name, value) => Input::Command(name, value),
        };
        let mut wanted = Vec::new();
        self.0.handle(now, input, &mut wanted);
        out.extend(wanted.into_iter().map(|output| match output {
            Output::Publish(publication) => PeerOutput::Publish(outgoing(publication)),
            Output::Fetch { token, url } => PeerOutput::Fetch { token, url },
            Output::Connect => PeerOutput::Connect,
            Output::Disconnect => PeerOutput::Disconnect,
            Output::Drop => PeerOutput::Drop,
            Output::Raw(bytes) => PeerOutput::Raw(bytes),
        }));
    }

    fn wake_up(&self) -> Option<Moment> {
        self.0.wake_up()
    }
}

/// A reference device's message as the links carry it.
pub(super) fn outgoing(publication: Publication) -> Outgoing {
    Outgoing {
        topic: publication.topic,
        payload: Bytes::from(publication.payload),
        qos: publication.qos,
        retain: publication.retain,
    }
}
