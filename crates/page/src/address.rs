//! Where the page is found by a tablet.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;

/// The address under which others reach what listens on `address`: one of this machine where it listens on all of them.
#[must_use]
pub fn reachable(address: SocketAddr) -> SocketAddr {
    if !address.ip().is_unspecified() {
        return address;
    }
    // Nothing is sent: the system only says by which of its addresses it would reach a network. These are for examples.
    let (own, elsewhere): (IpAddr, IpAddr) = if address.is_ipv4() {
        (Ipv4Addr::UNSPECIFIED.into(), Ipv4Addr::new(192, 0, 2, 1).into())
    } else {
        (
            Ipv6Addr::UNSPECIFIED.into(),
            Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1).into(),
        )
    };
    let routed = UdpSocket::bind((own, 0)).and_then(|socket| {
        socket.connect((elsewhere, 9))?;
        socket.local_addr()
    });
    let here = if address.is_ipv4() {
        Ipv4Addr::LOCALHOST.into()
    } else {
        Ipv6Addr::LOCALHOST.into()
    };
    SocketAddr::new(routed.map_or(here, |routed| routed.ip()), address.port())
}

/// A text as a QR code for a terminal that writes light on dark, as most do; empty where it is too long for one.
#[must_use]
pub fn qr_code(text: &str) -> String {
    let Ok(code) = QrCode::new(text) else {
        return String::new();
    };
    // What is written is light there, and a code is dark on light.
    code.render::<Dense1x2>()
        .dark_color(Dense1x2::Light)
        .light_color(Dense1x2::Dark)
        .build()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_of_one_network_stays_and_one_of_all_becomes_one() {
        for stays in ["127.0.0.1:8080", "192.0.2.7:80", "[::1]:8080"] {
            let address: SocketAddr = stays.parse().expect("an address");
            assert_eq!(reachable(address), address);
        }
        let all: SocketAddr = "0.0.0.0:8080".parse().expect("an address");
        let one = reachable(all);
        assert!(!one.ip().is_unspecified() && one.port() == 8080, "{one}");
    }

    #[test]
    fn a_code_has_lines_of_one_width_and_too_long_a_text_has_none() {
        let code = qr_code("http://192.0.2.7:8080/0123456789abcdef0123456789abcdef/");
        let widths: Vec<usize> = code.lines().map(|line| line.chars().count()).collect();
        assert!(
            widths.len() > 15 && widths.iter().all(|width| *width == widths[0]),
            "{code}"
        );
        assert_eq!(qr_code(&"x".repeat(5_000)), "");
    }
}
