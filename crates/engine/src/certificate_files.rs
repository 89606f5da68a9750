//! Certificates that the harness makes for a device: a small authority, another one for each test.

use std::path::PathBuf;

use bytes::Bytes;
use tck_suite::model::CertificateFile;

/// The files of one test.
#[derive(Debug, Default)]
pub(super) struct CertificateFiles {
    made: Option<(String, Made)>,
}

/// What was made, as PEM.
#[derive(Debug)]
#[cfg_attr(not(feature = "tls"), allow(dead_code, reason = "without TLS nothing is made"))]
struct Made {
    authority: String,
    certificate: String,
    key: String,
    stray_certificate: String,
    other_key: String,
}

/// What looks like a certificate: the text `no certificate` between the marks of one.
const BROKEN: &str = "-----BEGIN CERTIFICATE-----\nbm8gY2VydGlmaWNhdGU=\n-----END CERTIFICATE-----\n";

impl CertificateFiles {
    /// A file for a test, which is made with the others of that test when the first one is asked for. A device that takes
    /// the authority over has to trust what is in `trusted` as before.
    ///
    /// # Errors
    /// When none can be made, or a file cannot be read; the text says why.
    pub(super) fn content(
        &mut self,
        file: CertificateFile,
        (test, device): (&str, &str),
        now: jiff::Timestamp,
        trusted: &[PathBuf],
    ) -> Result<Bytes, String> {
        let made = match self.made.take() {
            Some((of, made)) if of == test => made,
            _ => made(device, now)?,
        };
        let content = match file {
            CertificateFile::Authority => with(&made.authority, trusted)?,
            CertificateFile::Certificate => made.certificate.clone(),
            CertificateFile::Key => made.key.clone(),
            CertificateFile::StrayCertificate => made.stray_certificate.clone(),
            CertificateFile::OtherKey => made.other_key.clone(),
            CertificateFile::BrokenCertificate => BROKEN.to_owned(),
        };
        self.made = Some((test.to_owned(), made));
        Ok(content.into())
    }
}

/// An authority, and behind it what else is to be trusted.
fn with(authority: &str, trusted: &[PathBuf]) -> Result<String, String> {
    let mut all = authority.to_owned();
    for path in trusted {
        let more = std::fs::read_to_string(path);
        all.push_str(&more.map_err(|error| format!("cannot read the certificate {}: {error}", path.display()))?);
        if !all.ends_with('\n') {
            all.push('\n');
        }
    }
    Ok(all)
}

#[cfg(not(feature = "tls"))]
fn made(_: &str, _: jiff::Timestamp) -> Result<Made, String> {
    Err("this build makes no certificates: it was made without the feature `tls`".to_owned())
}

/// Makes all files for a device of this name.
#[cfg(feature = "tls")]
fn made(device: &str, now: jiff::Timestamp) -> Result<Made, String> {
    make(device, now).map_err(|error| format!("cannot make a certificate: {error}"))
}

#[cfg(feature = "tls")]
fn make(device: &str, now: jiff::Timestamp) -> Result<Made, rcgen::Error> {
    use rcgen::{BasicConstraints, CertifiedIssuer, ExtendedKeyUsagePurpose, IsCa, KeyPair, KeyUsagePurpose};

    let mut root = named("vda5050-tck", now);
    root.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    root.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    let mut own = named(device, now);
    own.is_ca = IsCa::ExplicitNoCa;
    own.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    own.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
    own.use_authority_key_identifier_extension = true;
    let key = KeyPair::generate()?;
    let authority = CertifiedIssuer::self_signed(root.clone(), KeyPair::generate()?)?;
    let stranger = CertifiedIssuer::self_signed(root, KeyPair::generate()?)?;
    Ok(Made {
        authority: authority.pem(),
        certificate: own.signed_by(&key, &authority)?.pem(),
        stray_certificate: own.signed_by(&key, &stranger)?.pem(),
        key: key.serialize_pem(),
        other_key: KeyPair::generate()?.serialize_pem(),
    })
}

/// A certificate for this name, which is valid from the day before for somewhat less than a year. Nothing is older than
/// the time that certificates count from.
#[cfg(feature = "tls")]
fn named(name: &str, now: jiff::Timestamp) -> rcgen::CertificateParams {
    use jiff::ToSpan as _;

    let today = now.to_zoned(jiff::tz::TimeZone::UTC).date();
    let day = |date: jiff::civil::Date| {
        let month = u8::try_from(date.month()).unwrap_or(1);
        rcgen::date_time_ymd(date.year().into(), month, u8::try_from(date.day()).unwrap_or(1))
    };
    let mut params = rcgen::CertificateParams::default();
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.distinguished_name.push(rcgen::DnType::CommonName, name);
    params.not_before = day(today.saturating_sub(1.day()).max(jiff::civil::date(1970, 1, 1)));
    params.not_after = day(today.saturating_add(11.months()));
    params
}

#[cfg(test)]
#[cfg(feature = "tls")]
mod tests {
    use super::*;

    fn pem(files: &mut CertificateFiles, file: CertificateFile, test: &str) -> Bytes {
        let now = jiff::Timestamp::UNIX_EPOCH;
        files.content(file, (test, "agv-1"), now, &[]).unwrap()
    }

    #[test]
    fn the_files_of_a_test_belong_together_and_another_test_has_others() {
        let mut files = CertificateFiles::default();
        let key = pem(&mut files, CertificateFile::Key, "a");
        assert_eq!(pem(&mut files, CertificateFile::Key, "a"), key);
        assert_ne!(pem(&mut files, CertificateFile::OtherKey, "a"), key);
        let certificate = pem(&mut files, CertificateFile::Certificate, "a");
        assert_ne!(pem(&mut files, CertificateFile::StrayCertificate, "a"), certificate);
        assert_ne!(pem(&mut files, CertificateFile::Key, "b"), key);
    }

    #[test]
    fn what_was_trusted_before_stands_behind_the_authority() {
        let mut files = CertificateFiles::default();
        let now = jiff::Timestamp::UNIX_EPOCH;
        let missing = files.content(CertificateFile::Authority, ("a", "x"), now, &["no/such.pem".into()]);
        assert!(missing.unwrap_err().contains("no/such.pem"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ca.crt");
        std::fs::write(&path, "site").unwrap();
        let both = files
            .content(CertificateFile::Authority, ("a", "x"), now, &[path])
            .unwrap();
        let both = String::from_utf8(both.to_vec()).unwrap();
        assert!(
            both.starts_with("-----BEGIN CERTIFICATE-----") && both.ends_with("-----\nsite\n"),
            "{both}"
        );
    }
}
