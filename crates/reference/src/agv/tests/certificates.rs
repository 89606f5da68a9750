//! A certificate that is given to the vehicle: fetched file by file, looked into, and used or not.

use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};

use super::*;

/// The links of a set, by parameter.
const LINKS: [&str; 3] = [
    "keyDownloadLink",
    "certificateDownloadLink",
    "certificateAuthorityDownloadLink",
];

/// Key, certificate and authority as PEM, in the order in which they are fetched.
type Files = [String; 3];

fn authority() -> CertifiedIssuer<'static, KeyPair> {
    let mut params = CertificateParams::default();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap()
}

fn good() -> Files {
    let (authority, key) = (authority(), KeyPair::generate().unwrap());
    let certificate = CertificateParams::default().signed_by(&key, &authority).unwrap();
    [key.serialize_pem(), certificate.pem(), authority.pem()]
}

/// What comes of a set.
fn given(files: &[String], faults: &[&str]) -> String {
    let mut config = config();
    config.features.insert("certificates".into());
    let mut bench = Bench::with(config, faults);
    let mut parameters = json!({ "service": "MQTT" });
    for link in &LINKS[..files.len()] {
        parameters[*link] = json!(format!("https://127.0.0.1:1/{link}"));
    }
    bench.instant("updateCertificate", "u", parameters);
    for file in files {
        if bench.status("u") == "RUNNING" {
            bench.download(Download::Begun);
            bench.download(Download::Done(file.clone().into()));
        }
    }
    bench.status("u")
}

#[test]
fn a_set_that_fits_is_used_with_and_without_an_authority() {
    let files = good();
    assert_eq!(given(&files, &[]), "FINISHED");
    assert_eq!(given(&files[..2], &[]), "FINISHED");
    assert_eq!(
        given(&files[..1], &[]),
        "FAILED",
        "the link to the certificate is missing"
    );
}

#[test]
fn what_does_not_fit_is_refused_and_used_by_the_fault_that_does_not_look() {
    let [key, certificate, root] = good();
    let [other, ..] = good();
    let broken = "-----BEGIN CERTIFICATE-----\nbm8gY2VydGlmaWNhdGU=\n-----END CERTIFICATE-----\n";
    let stray = authority().pem();
    let cases: [(Files, &str); 5] = [
        ([other, certificate.clone(), root.clone()], "other-key-activated"),
        (
            [key.clone(), broken.into(), root.clone()],
            "broken-certificate-activated",
        ),
        (
            ["no key".into(), certificate.clone(), root],
            "broken-certificate-activated",
        ),
        (
            [key.clone(), certificate.clone(), "no certificate".into()],
            "broken-certificate-activated",
        ),
        ([key, certificate, stray], "certificate-chain-unchecked"),
    ];
    for (files, fault) in cases {
        assert_eq!(given(&files, &[]), "FAILED", "{fault}");
        assert_eq!(given(&files, &[fault]), "FINISHED", "{fault}");
    }
}
