//! Fetches files for a device: by plain threads, so that a server that stalls keeps nobody waiting at the end.

use std::path::PathBuf;
use std::time::Duration;

use bytes::Bytes;
use tokio::sync::mpsc;

use tck_base::device::Download;
use tck_net::bench::web;
use tck_net::maps::FETCH_TIMEOUT;

/// Largest file a device fetches.
const LARGEST_FILE: u64 = 256 << 20;
/// How long a file may take once its first byte is here.
const TRANSFER_LIMIT: Duration = Duration::from_secs(120);

/// How a download of a device goes on: by the device's own number for it.
pub(super) type Progress = (u64, Download);

/// Fetches a file in a thread of its own.
pub(super) fn fetch(
    token: u64,
    url: String,
    authority: Option<PathBuf>,
    progress: mpsc::UnboundedSender<Box<Progress>>,
) {
    std::thread::spawn(move || {
        let begun = || drop(progress.send(Box::new((token, Download::Begun))));
        let end = match download(&url, authority.as_ref(), begun) {
            Ok(body) => Download::Done(body),
            Err(error) => Download::Failed(error.to_string()),
        };
        let _ = progress.send(Box::new((token, end)));
    });
}

fn download(url: &str, authority: Option<&PathBuf>, begun: impl FnOnce()) -> Result<Bytes, ureq::Error> {
    let agent = web::agent(url, authority, |limits| {
        limits
            .timeout_connect(Some(FETCH_TIMEOUT))
            .timeout_recv_response(Some(FETCH_TIMEOUT))
            .timeout_recv_body(Some(TRANSFER_LIMIT))
    });
    let agent = agent.map_err(|error| std::io::Error::other(error.to_string()))?;
    let response = agent.get(url).call()?;
    begun();
    let body = response
        .into_body()
        .into_with_config()
        .limit(LARGEST_FILE)
        .read_to_vec()?;
    Ok(body.into())
}
