//! Opening recordings: files and standard input, packed with gzip or zstd or not packed.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::CaptureError;
use super::wide::{Order, Wide};

/// How long it takes until a file is looked at again that may have grown.
const PAUSE: Duration = Duration::from_millis(100);
/// How much is read at once.
const BUFFER: usize = 1 << 16;
const GZIP: &[u8] = &[0x1f, 0x8b];
const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// What is not read, by its first bytes, and what to do.
const REFUSED: [(&[u8], &str); 6] = [
    (
        b"PK\x03\x04",
        "a ZIP archive: unpack it, and name the recordings in it; gzip and zstd are read as they are",
    ),
    (b"PK\x05\x06", "a ZIP archive with nothing in it"),
    (
        b"BZh",
        "packed with bzip2: unpack it; gzip and zstd are read as they are",
    ),
    (
        b"\xfd7zX",
        "packed with xz: unpack it; gzip and zstd are read as they are",
    ),
    (
        b"7z\xbc\xaf",
        "a 7z archive: unpack it; gzip and zstd are read as they are",
    ),
    (
        b"SQLi",
        "a data base of SQLite: export the messages as JSON lines or CSV, with topic and payload",
    ),
];

/// Opens a recording; `-` is standard input.
///
/// # Errors
/// What the operating system says, or what is wrong with the packing.
pub fn open(path: &Path) -> Result<Box<dyn BufRead>, CaptureError> {
    let name = path.display().to_string();
    let raw: Result<Box<dyn Read>, io::Error> = if path.as_os_str() == "-" {
        Ok(Box::new(io::stdin()))
    } else {
        File::open(path).map(|file| Box::new(file) as Box<dyn Read>)
    };
    raw.and_then(unpacked).map_err(|source| CaptureError { name, source })
}

/// Opens a file that grows: where it ends, more is waited for, until `stop` becomes true.
///
/// # Errors
/// What the operating system says.
pub fn follow(path: &Path, stop: Arc<AtomicBool>) -> io::Result<Box<dyn BufRead>> {
    let file = File::open(path)?;
    Ok(Box::new(BufReader::with_capacity(BUFFER, Growing { file, stop })))
}

/// See [`follow`].
struct Growing {
    file: File,
    stop: Arc<AtomicBool>,
}

impl Read for Growing {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.file.read(buffer)?;
            if read > 0 || buffer.is_empty() || self.stop.load(Ordering::Relaxed) {
                return Ok(read);
            }
            std::thread::sleep(PAUSE);
        }
    }
}

/// What something is that is not text in UTF-8, by its first bytes, and what to do; `None` where they do not tell.
#[must_use]
pub fn no_plain_text(begin: &[u8]) -> Option<&'static str> {
    if let Some((_, what)) = REFUSED.iter().find(|(bytes, _)| begin.starts_with(bytes)) {
        return Some(what);
    }
    if Order::of(begin).is_some() {
        return Some("UTF-16, where UTF-8 is due: convert it, such as with `iconv -f UTF-16 -t UTF-8`");
    }
    let packed = [
        (GZIP, "packed with gzip: unpack it"),
        (ZSTD, "packed with zstd: unpack it"),
    ];
    packed
        .into_iter()
        .find(|(bytes, _)| begin.starts_with(bytes))
        .map(|(_, what)| what)
}

/// What is read, unpacked if it is packed.
///
/// # Errors
/// What is wrong with the packing.
pub fn unpacked(raw: Box<dyn Read>) -> io::Result<Box<dyn BufRead>> {
    let mut raw = BufReader::with_capacity(BUFFER, raw);
    // A pipe may give its first bytes one by one.
    let begin = first_bytes(&mut raw)?;
    if let Some((_, what)) = REFUSED.iter().find(|(bytes, _)| begin.starts_with(bytes)) {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("it is {what}")));
    }
    let whole = io::Cursor::new(begin.clone()).chain(raw);
    Ok(if let Some(order) = Order::of(&begin) {
        Box::new(BufReader::with_capacity(BUFFER, Wide::new(whole, order)))
    } else if begin.starts_with(GZIP) {
        Box::new(BufReader::with_capacity(
            BUFFER,
            flate2::bufread::MultiGzDecoder::new(whole),
        ))
    } else if begin.starts_with(ZSTD) {
        Box::new(BufReader::with_capacity(BUFFER, Frames::new(Box::new(whole))?))
    } else {
        Box::new(whole)
    })
}

type Packed = Box<dyn BufRead>;

/// Zstd, one frame after the other: what packs in parallel writes many.
struct Frames {
    frame: Option<ruzstd::decoding::StreamingDecoder<Packed, ruzstd::decoding::FrameDecoder>>,
}

impl Frames {
    fn new(packed: Packed) -> io::Result<Self> {
        let frame = ruzstd::decoding::StreamingDecoder::new(packed)
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.to_string()))?;
        Ok(Self { frame: Some(frame) })
    }
}

impl Read for Frames {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(frame) = &mut self.frame {
            let read = frame.read(buffer)?;
            if read > 0 || buffer.is_empty() {
                return Ok(read);
            }
            let Some(mut rest) = self.frame.take().map(ruzstd::decoding::StreamingDecoder::into_inner) else {
                break;
            };
            if !rest.fill_buf()?.is_empty() {
                *self = Self::new(rest)?;
            }
        }
        Ok(0)
    }
}

fn first_bytes(raw: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut begin = Vec::new();
    raw.by_ref().take(ZSTD.len() as u64).read_to_end(&mut begin)?;
    Ok(begin)
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn text_of(bytes: Vec<u8>) -> io::Result<String> {
        let mut text = String::new();
        unpacked(Box::new(io::Cursor::new(bytes)))?.read_to_string(&mut text)?;
        Ok(text)
    }

    #[test]
    fn packed_or_not_the_text_is_the_same() {
        let text = "a/b {}\n".repeat(1000);
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(text.as_bytes()).expect("packed");
        let zstd = ruzstd::encoding::compress_to_vec(text.as_bytes(), ruzstd::encoding::CompressionLevel::Fastest);
        assert_eq!(text_of(gzip.finish().expect("packed")).expect("gzip"), text);
        assert_eq!(text_of(zstd.repeat(2)).expect("two frames"), text.repeat(2));
        assert_eq!(text_of(zstd).expect("zstd"), text);
        assert_eq!(text_of(text.clone().into_bytes()).expect("plain"), text);
        assert_eq!(text_of(Vec::new()).expect("empty"), "");
        assert_eq!(text_of(b"{".to_vec()).expect("short"), "{");
    }

    #[test]
    fn utf_16_is_read_whatever_its_order_and_with_characters_of_two_halves() {
        let text = "{\"a\": \"\u{e4}\u{1f69a}\"}\n".repeat(9000);
        for (mark, order) in [(true, true), (true, false), (false, true), (false, false)] {
            let units = mark.then_some(0xfeff).into_iter().chain(text.encode_utf16());
            let bytes = units.flat_map(|unit: u16| if order { unit.to_le_bytes() } else { unit.to_be_bytes() });
            let read = text_of(bytes.collect()).expect("UTF-16");
            assert_eq!(read.trim_start_matches('\u{feff}'), text);
        }
        assert_eq!(text_of(b"{\0\x00\xd8".to_vec()).expect("half"), "{\u{fffd}");
        assert_eq!(text_of(b"{\0\x00".to_vec()).expect("cut"), "{");
    }

    #[test]
    fn what_is_not_read_is_named_with_what_to_do() {
        for (begin, wanted) in [
            (&b"PK\x03\x04rest"[..], "ZIP archive"),
            (b"BZh91AY", "bzip2"),
            (b"\xfd7zXZ\0", "xz"),
            (b"7z\xbc\xaf'", "7z"),
            (b"SQLite format 3\0", "JSON lines or CSV"),
        ] {
            let error = text_of(begin.to_vec()).expect_err("refused").to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }

    #[test]
    fn what_is_no_plain_text_is_named() {
        for (begin, wanted) in [
            (&b"\xff\xfe{\0"[..], "UTF-16"),
            (b"\xfe\xff\0{", "UTF-16"),
            (b"{\0\"\0", "UTF-16"),
            (b"PK\x03\x04rest", "ZIP archive"),
            (&[0x1f, 0x8b, 8, 0], "gzip"),
            (&[0x28, 0xb5, 0x2f, 0xfd], "zstd"),
        ] {
            assert!(
                no_plain_text(begin).is_some_and(|what| what.contains(wanted)),
                "{wanted}"
            );
        }
        for text in [&b"{}"[..], b"\xef\xbb\xbf{}", b"", b"[", b"{\"a\":\"\xff\"}"] {
            assert_eq!(no_plain_text(text), None);
        }
    }

    #[test]
    fn a_broken_packing_is_an_error() {
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(&[b'x'; 4000]).expect("packed");
        let mut bytes = gzip.finish().expect("packed");
        bytes.truncate(bytes.len() - 9);
        assert!(text_of(bytes).is_err());
        assert!(text_of(vec![0x28, 0xb5, 0x2f, 0xfd, 1, 2, 3]).is_err());
    }
}
