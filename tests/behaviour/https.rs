//! A server of somebody else that speaks HTTPS: it answers what the path says, such as 204, and a file with 200.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::{Arc, Mutex};

use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{ServerConfig, ServerConnection, StreamOwned, crypto::ring};

/// It keeps what it was asked.
pub struct Server {
    port: u16,
    pub asked: Arc<Mutex<Vec<String>>>,
}

impl Server {
    /// Starts one with the certificates in a folder. It runs until the tests end.
    pub fn start(folder: &Path) -> Self {
        let chain = CertificateDer::pem_file_iter(folder.join("server.crt")).unwrap();
        let chain = chain.map(Result::unwrap).collect();
        let key = PrivateKeyDer::from_pem_file(folder.join("server.key")).unwrap();
        let config = ServerConfig::builder_with_provider(ring::default_provider().into())
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_no_client_auth()
            .with_single_cert(chain, key)
            .unwrap();
        let config = Arc::new(config);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&asked);
        std::thread::spawn(move || {
            for socket in listener.incoming() {
                let connection = ServerConnection::new(Arc::clone(&config)).unwrap();
                answer(StreamOwned::new(connection, socket.unwrap()), &kept);
            }
        });
        Self { port, asked }
    }

    /// An address whose path begins with the code that is answered.
    pub fn url(&self, path: &str) -> String {
        format!("https://localhost:{}/{path}", self.port)
    }
}

fn answer(mut stream: StreamOwned<ServerConnection, TcpStream>, asked: &Mutex<Vec<String>>) {
    let mut request = Vec::new();
    let mut part = [0; 4096];
    while !request.windows(4).any(|end| end == b"\r\n\r\n") {
        match stream.read(&mut part) {
            Ok(length @ 1..) => request.extend_from_slice(&part[..length]),
            _ => return,
        }
    }
    let request = String::from_utf8(request).unwrap();
    let code = request
        .split('/')
        .nth(1)
        .unwrap()
        .split(['?', ' '])
        .next()
        .unwrap()
        .to_owned();
    asked.lock().unwrap().push(request);
    let body = if code == "200" { "a file" } else { "" };
    let _ = write!(
        stream,
        "HTTP/1.1 {code} Because\r\ncontent-length: {}\r\nconnection: close\r\n\r\n{body}",
        body.len()
    );
    let _ = stream.flush();
}
