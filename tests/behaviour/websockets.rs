//! A WebSocket in front of a broker that speaks MQTT over TCP, as proxies of cloud sites have it.

use std::path::Path;
use std::sync::Arc;

use futures_util::{SinkExt as _, StreamExt as _};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{ServerConfig, crypto::ring};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::handshake::server::{ErrorResponse, Request, Response};

/// Opens one, with TLS if there are certificates; gives its port. It runs until the tests end.
pub fn before(broker: u16, certificates: Option<&Path>) -> u16 {
    let acceptor = certificates.map(|folder| TlsAcceptor::from(Arc::new(server(folder))));
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(async {
            let listener = TcpListener::from_std(listener).unwrap();
            while let Ok((socket, _)) = listener.accept().await {
                let acceptor = acceptor.clone();
                tokio::spawn(async move {
                    match acceptor {
                        None => carry(socket, broker).await,
                        Some(acceptor) => {
                            if let Ok(secured) = acceptor.accept(socket).await {
                                carry(secured, broker).await;
                            }
                        }
                    }
                });
            }
        });
    });
    port
}

fn server(folder: &Path) -> ServerConfig {
    let chain = CertificateDer::pem_file_iter(folder.join("server.crt")).unwrap();
    let chain = chain.map(Result::unwrap).collect();
    let key = PrivateKeyDer::from_pem_file(folder.join("server.key")).unwrap();
    ServerConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .unwrap()
}

#[expect(clippy::result_large_err, reason = "the shape of the library")]
#[expect(clippy::unnecessary_wraps, reason = "this is what the handshake calls")]
fn with_protocol(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    if let Some(protocol) = request.headers().get("Sec-WebSocket-Protocol") {
        response
            .headers_mut()
            .insert("Sec-WebSocket-Protocol", protocol.clone());
    }
    Ok(response)
}

async fn carry(socket: impl AsyncRead + AsyncWrite + Unpin + Send, broker: u16) {
    let Ok(socket) = tokio_tungstenite::accept_hdr_async(socket, with_protocol).await else {
        return;
    };
    let Ok(mut tcp) = TcpStream::connect(("127.0.0.1", broker)).await else {
        return;
    };
    let (mut to_client, mut from_client) = socket.split();
    let (mut from_broker, mut to_broker) = tcp.split();
    let up = async {
        while let Some(Ok(message)) = from_client.next().await {
            if let Message::Binary(bytes) = message
                && to_broker.write_all(&bytes).await.is_err()
            {
                return;
            }
        }
        let _ = to_broker.shutdown().await;
    };
    let down = async {
        let mut part = [0; 4096];
        while let Ok(length @ 1..) = from_broker.read(&mut part).await {
            if to_client.send(Message::binary(part[..length].to_vec())).await.is_err() {
                return;
            }
        }
    };
    tokio::select! {
        () = up => {}
        () = down => {}
    }
}
