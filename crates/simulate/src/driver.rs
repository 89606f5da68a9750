//! Runs a reference device against a real broker or tap.
//!
//! The device decides everything; the driver owns the sockets and the clock. Messages of a device without a
//! connection are dropped. A device is one task and nothing else, since thousands of them live in a process: its connection is
//! part of the task, and what it says at one moment is one write.

use std::time::Duration;

use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};

use super::fetching::{Progress, fetch};
use super::witness::{Witness, report};
use tck_base::clock::{Moment, WallClock};
use tck_base::device::{Commanded, Device, Input, Output, Publication};
use tck_net::bench::client::{ClientEvent, ClientOptions};
use tck_net::bench::endpoint::Endpoint;
use tck_net::bench::light::LightClient;
use tck_net::link::mqtt::Reporter;

/// A device that wants to be woken again and again at the same moment gets on in steps of this.
const LEAST_WAKE: Duration = Duration::from_millis(1);
/// How long is waited until a broker has let a device in.
const ENTRY_LIMIT: Duration = Duration::from_secs(15);

/// A command for a running device.
#[derive(Debug)]
pub struct Command {
    name: String,
    parameter: Value,
    /// Told when the device has it, so that what is sent next comes after it, or why it does not do it.
    done: oneshot::Sender<Commanded>,
}

/// A device that runs in a task of its own.
pub struct RunningDevice {
    commands: mpsc::UnboundedSender<Box<Command>>,
    first: Option<oneshot::Receiver<Result<(), String>>>,
    running: JoinHandle<()>,
}

impl RunningDevice {
    /// Runs `device` against `endpoint`. What a device of the harness itself publishes is reported to `sent`.
    #[must_use]
    pub fn start(
        device: impl Device + Send + 'static,
        endpoint: Endpoint,
        clock: WallClock,
        sent: Option<Reporter>,
    ) -> Self {
        let (commands, receiver) = mpsc::unbounded_channel();
        let (told, first) = oneshot::channel();
        let running = tokio::spawn(run_device(Box::new(device), endpoint, clock, receiver, (sent, told)));
        Self {
            commands,
            first: Some(first),
            running,
        }
    }

    /// Waits until the broker has let the device in, or the device has waited for that long enough.
    ///
    /// # Errors
    /// Why the broker does not let it in; the device tries again.
    pub async fn is_let_in(&mut self) -> Result<(), String> {
        let Some(first) = self.first.take() else { return Ok(()) };
        match tokio::time::timeout(ENTRY_LIMIT, first).await {
            Ok(Ok(let_in)) => let_in,
            // The device does not want to be there yet.
            _ => Ok(()),
        }
    }

    /// Does something to the device, and waits until that is done. `false` when it does not do it, or is not running any more.
    pub async fn command(&self, name: &str, parameter: Value) -> bool {
        self.ask(name, parameter).await == Commanded::Taken
    }

    /// Does something to the device, and waits until that is done or declined.
    pub async fn ask(&self, name: &str, parameter: Value) -> Commanded {
        let (done, heard) = oneshot::channel();
        let command = Command {
            name: name.to_owned(),
            parameter,
            done,
        };
        match self.commands.send(Box::new(command)) {
            Ok(()) => heard.await.unwrap_or(Commanded::Nobody),
            Err(_) => Commanded::Nobody,
        }
    }

    /// Ends the device with DISCONNECT.
    pub async fn stop(self) {
        drop(self.commands);
        let _ = self.running.await;
    }

    /// Ends the device as if its power were cut.
    pub async fn kill(self) {
        self.running.abort();
        let _ = self.running.await;
    }
}

/// Runs `device` until the senders of `commands` are gone, and then disconnects it in order. What a device of
/// the harness itself publishes is reported to `sent`, and how its first connection went to `told`.
async fn run_device<D: Device>(
    device: Box<D>,
    endpoint: Endpoint,
    clock: WallClock,
    commands: mpsc::UnboundedReceiver<Box<Command>>,
    (sent, told): (Option<Reporter>, oneshot::Sender<Result<(), String>>),
) {
    let (downloads, progress) = mpsc::unbounded_channel();
    let driver = Driver {
        device,
        endpoint,
        clock,
        sent,
        told: Some(told),
        connection: None,
        client_id: String::new(),
        will: None,
        established: false,
        downloads,
    };
    driver.run(commands, progress).await;
}

struct Driver<D> {
    /// In a box, since a task has room for its arguments more than once.
    device: Box<D>,
    endpoint: Endpoint,
    clock: WallClock,
    sent: Option<Reporter>,
    /// Told how the first connection went.
    told: Option<oneshot::Sender<Result<(), String>>>,
    connection: Option<LightClient>,
    client_id: String,
    will: Option<Publication>,
    established: bool,
    downloads: mpsc::UnboundedSender<Box<Progress>>,
}

impl<D: Device> Driver<D> {
    async fn run(
        mut self,
        mut commands: mpsc::UnboundedReceiver<Box<Command>>,
        mut progress: mpsc::UnboundedReceiver<Box<Progress>>,
    ) {
        self.give(Input::Time).await;
        let mut earliest = Moment::START;
        loop {
            let wake_up = self.device.wake_up().map(|wake_up| wake_up.max(earliest));
            let now = self.clock.now().moment;
            if wake_up.is_some_and(|wake_up| wake_up <= now) {
                earliest = now + LEAST_WAKE;
                self.give(Input::Time).await;
                continue;
            }
            let alarm = Instant::from_std(self.clock.instant(wake_up.unwrap_or_default()));
            tokio::select! {
                event = next_event(&mut self.connection) => self.happened(event).await,
                Some(made) = progress.recv() => {
                    let (token, progress) = *made;
                    self.give(Input::Download { token, progress }).await;
                }
                command = commands.recv() => match command {
                    Some(command) => {
                        let Command { name, parameter, done } = *command;
                        let commanded = match self.device.declines(&name, &parameter) {
                            Some(why) => Commanded::Declined(why),
                            None => {
                                self.give(Input::Command(name, parameter)).await;
                                Commanded::Taken
                            }
                        };
                        // Whoever asked may have stopped waiting.
                        let _ = done.send(commanded);
                    }
                    None => break,
                },
                () = sleep_until(alarm), if wake_up.is_some() => {}
            }
        }
        if let Some(client) = self.connection.take() {
            client.disconnect().await;
        }
    }

    async fn happened(&mut self, event: ClientEvent) {
        match event {
            ClientEvent::Connected => {
                self.tell(Ok(()));
                self.established = true;
                self.give(Input::Connected).await;
            }
            ClientEvent::Message { topic, payload, .. } => {
                if let Some(reporter) = &self.sent {
                    reporter.has_heard(&topic, &payload).await;
                }
                self.give(Input::Message { topic, payload }).await;
            }
            ClientEvent::Lost(reason) => {
                self.tell(Err(reason.clone()));
                tracing::debug!(client = self.client_id, reason, "a device lost its connection");
                self.connection = None;
                self.established = false;
                self.give(Input::ConnectionLost).await;
            }
        }
    }

    fn tell(&mut self, outcome: Result<(), String>) {
        if let Some(told) = self.told.take() {
            // Nobody may want to know.
            let _ = told.send(outcome);
        }
    }

    /// Gives the device an input and does what it wants.
    async fn give(&mut self, input: Input) {
        let mut wanted = Vec::new();
        self.device.handle(self.clock.now(), input, &mut wanted);
        for output in wanted {
            match output {
                Output::Publish(publication) => self.publish(publication).await,
                Output::Fetch { token, url } => {
                    fetch(token, url, self.endpoint.authority.clone(), self.downloads.clone());
                }
                Output::Connect => self.connect(),
                Output::Disconnect => {
                    self.established = false;
                    if let Some(client) = self.connection.take() {
                        client.disconnect().await;
                    }
                }
                Output::Drop => {
                    // What was said before goes out before.
                    self.flush().await;
                    self.established = false;
                    let witness = match (self.sent.clone(), self.will.clone()) {
                        (Some(reporter), Some(will)) if self.connection.is_some() => {
                            Some(Box::pin(Witness::open(&self.endpoint, &self.client_id, will, reporter)).await)
                        }
                        _ => None,
                    };
                    self.connection = None;
                    if let Some(witness) = witness {
                        tokio::spawn(witness.testify());
                    }
                }
                Output::Raw(bytes) => {
                    self.flush().await;
                    let (endpoint, id) = (self.endpoint.clone(), format!("{}-raw", self.client_id));
                    tokio::spawn(async move {
                        if let Err(error) = send_raw(&endpoint, &id, &bytes).await {
                            tracing::debug!(%error, "raw bytes could not be sent");
                        }
                    });
                }
            }
        }
        self.flush().await;
    }

    /// Sends what the device has said, in one go.
    async fn flush(&mut self) {
        if let Some(client) = &mut self.connection {
            client.flush().await;
        }
    }

    fn connect(&mut self) {
        let options = self.device.connect_options(self.clock.now());
        self.client_id = self.endpoint.client_id.clone().unwrap_or(options.client_id);
        self.will = options.will;
        self.established = false;
        self.connection = Some(LightClient::open(ClientOptions {
            endpoint: self.endpoint.clone(),
            client_id: self.client_id.clone(),
            keep_alive: options.keep_alive,
            clean_session: options.clean_session,
            will: self.will.clone(),
            subscriptions: options.subscriptions,
        }));
    }

    async fn publish(&mut self, message: Publication) {
        let Some(client) = self.connection.as_mut().filter(|_| self.established) else {
            return;
        };
        if let Some(reporter) = &self.sent {
            report(reporter, &message).await;
        }
        client.publish(message);
    }
}

async fn next_event(connection: &mut Option<LightClient>) -> ClientEvent {
    match connection {
        Some(client) => client.next().await,
        None => std::future::pending().await,
    }
}

/// Sends bytes that no client library would send. They cannot go over the device's own connection, whose
/// client sends packets only, so they get one of their own, opened with a CONNECT of MQTT 3.1.1.
async fn send_raw(endpoint: &Endpoint, client_id: &str, bytes: &[u8]) -> std::io::Result<()> {
    let mut socket = TcpStream::connect((endpoint.host.as_str(), endpoint.port)).await?;
    socket.set_nodelay(true)?;
    let plain = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'-';
    let id: Vec<u8> = client_id.bytes().filter(plain).take(100).collect();
    let length = u8::try_from(id.len()).unwrap_or_default();
    let mut connect = vec![0x10, 12 + length, 0, 4, b'M', b'Q', b'T', b'T', 4, 2, 0, 0, 0, length];
    connect.extend_from_slice(&id);
    socket.write_all(&connect).await?;
    let mut connack = [0; 4];
    socket.read_exact(&mut connack).await?;
    socket.write_all(bytes).await?;
    // The broker closes after what it cannot read; when it could read it, the connection has done its work.
    let mut rest = [0; 256];
    let closed = async { while socket.read(&mut rest).await.is_ok_and(|length| length > 0) {} };
    let _ = tokio::time::timeout(Duration::from_secs(1), closed).await;
    Ok(())
}
