//! Bytes both ways, over whatever carries them.

use tokio::io::{AsyncRead, AsyncWrite};

/// A connection: TCP, TLS or a WebSocket.
pub(crate) trait Stream: AsyncRead + AsyncWrite + Unpin + Send {}

impl<T: AsyncRead + AsyncWrite + Unpin + Send> Stream for T {}
