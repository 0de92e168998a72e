//! URIs inside a file: data URIs are decoded, relative ones checked to stay in the file's folder.

use base64::{
    Engine, alphabet,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};

/// Where a URI leads.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Target<'a> {
    /// Data inside the URI, not decoded yet.
    Data(DataUri<'a>),
    /// A file under the scene's folder, percent-decoded, with `/` between its parts.
    File(String),
}

/// The parts of a `data:` URI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DataUri<'a> {
    pub(super) media_type: &'a str,
    is_base64: bool,
    text: &'a str,
}

const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Sorts a URI.
///
/// # Errors
/// Network schemes, absolute paths, drive letters, `..` that leaves the folder, and bad percent codes.
pub(super) fn parse(uri: &str) -> Result<Target<'_>, String> {
    if let Some(rest) = strip_scheme(uri, "data:") {
        return parse_data(rest).map(Target::Data);
    }
    let shown = shorten(uri);
    if let Some(scheme) = scheme(uri) {
        return Err(format!("{shown} has the scheme `{scheme}:`; only files beside the scene and data URIs are read"));
    }
    let path = percent_decode(uri).ok_or_else(|| format!("{shown} is not a valid URI"))?;
    let path = String::from_utf8(path).map_err(|_| format!("{shown} is not UTF-8"))?;
    inside_folder(&path).map(Target::File).map_err(|why| format!("{shown} {why}"))
}

/// The URI in quotes, cut after 80 characters, control characters escaped.
pub(super) fn shorten(uri: &str) -> String {
    let cut: String = uri.chars().take(80).flat_map(char::escape_debug).collect();
    if uri.chars().nth(80).is_some() { format!("`{cut}...`") } else { format!("`{cut}`") }
}

fn strip_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme).then(|| &uri[scheme.len()..])
}

/// What stands before the first `:` when that could be a scheme or a drive letter.
fn scheme(uri: &str) -> Option<&str> {
    let (head, _) = uri.split_once(':')?;
    head.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b)).then_some(head)
}

fn parse_data(rest: &str) -> Result<DataUri<'_>, String> {
    let (head, text) = rest.split_once(',').ok_or("data URI without a comma")?;
    let is_base64 = head.len() >= 7 && head.is_char_boundary(head.len() - 7) && {
        head[head.len() - 7..].eq_ignore_ascii_case(";base64")
    };
    if head.contains(";;") {
        return Err("data URI with an empty parameter".to_owned());
    }
    let media_type = head.split(';').next().unwrap_or_default();
    Ok(DataUri { media_type, is_base64, text })
}

impl DataUri<'_> {
    /// The bytes.
    ///
    /// # Errors
    /// When the text is not base64 or has bad percent codes.
    pub(super) fn decode(&self) -> Result<Vec<u8>, String> {
        if !self.is_base64 {
            return percent_decode(self.text).ok_or_else(|| "data URI with a bad percent code".to_owned());
        }
        let decode = |text: &[u8]| BASE64.decode(text).map_err(|error| format!("data URI: {error}"));
        if self.text.contains('%') {
            let text = percent_decode(self.text).ok_or("data URI with a bad percent code")?;
            return decode(&text);
        }
        decode(self.text.as_bytes())
    }

    /// Upper bound of the decoded length.
    pub(super) fn len_bound(&self) -> u64 {
        if self.is_base64 { self.text.len() as u64 / 4 * 3 + 3 } else { self.text.len() as u64 }
    }
}

fn percent_decode(text: &str) -> Option<Vec<u8>> {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        if bytes[at] == b'%' {
            let code = bytes.get(at + 1..at + 3)?;
            let digit = |b: u8| char::from(b).to_digit(16);
            out.push(u8::try_from(digit(code[0])? * 16 + digit(code[1])?).ok()?);
            at += 3;
        } else {
            out.push(bytes[at]);
            at += 1;
        }
    }
    Some(out)
}

/// Resolves `.` and `..` and refuses whatever would leave the folder.
fn inside_folder(path: &str) -> Result<String, &'static str> {
    if path.is_empty() {
        return Err("is empty");
    }
    if path.contains('\0') {
        return Err("holds a zero byte");
    }
    if path.starts_with(['/', '\\']) {
        return Err("is an absolute path; only files beside the scene are read");
    }
    if path.as_bytes().get(1) == Some(&b':') && path.as_bytes()[0].is_ascii_alphabetic() {
        return Err("names a drive; only files beside the scene are read");
    }
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop().ok_or("leaves the scene's folder; only files inside it are read")?;
            }
            part => parts.push(part),
        }
    }
    if parts.is_empty() { Err("names no file") } else { Ok(parts.join("/")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(uri: &str) -> Option<String> {
        match parse(uri) {
            Ok(Target::File(path)) => Some(path),
            _ => None,
        }
    }

    #[test]
    fn relative_uris_are_decoded_and_stay_in_the_folder() {
        assert_eq!(file("a%20b/c.bin").as_deref(), Some("a b/c.bin"));
        assert_eq!(file("./a/../b.bin").as_deref(), Some("b.bin"));
        assert_eq!(file("Unicode%E2%9D%A4.png").as_deref(), Some("Unicode❤.png"));
    }

    #[test]
    fn uris_that_leave_the_folder_are_refused_by_name() {
        let bad = [
            "../x.bin",
            "a/../../x.bin",
            "/etc/passwd",
            "\\x",
            "C:/x",
            "C%3A/x",
            "%2e%2e/x",
            "..%5cx",
            "http://h/x",
            "file:///x",
            "",
            ".",
            "a%0",
            "a%zz",
            "%2Fetc/passwd",
            "a%00b",
            "//host/x",
            ":",
        ];
        for uri in bad {
            let error = parse(uri).expect_err(uri);
            assert!(error.starts_with('`'), "{uri}: {error}");
        }
    }

    #[test]
    fn data_uris_decode_with_and_without_padding_and_base64() {
        let decode = |uri| match parse(uri) {
            Ok(Target::Data(data)) => data.decode(),
            other => panic!("{other:?}"),
        };
        assert_eq!(decode("data:application/octet-stream;base64,AAEC").unwrap(), [0, 1, 2]);
        assert_eq!(decode("data:;base64,AA==").unwrap(), [0]);
        assert_eq!(decode("DATA:;BASE64,AA").unwrap(), [0]);
        assert_eq!(decode("data:text/plain,a%20b").unwrap(), b"a b");
        assert!(decode("data:;base64,A$==").is_err());
        assert!(parse("data:nothing").is_err());
        assert!(parse("data:a/b;;base64,AA==").is_err());
    }
}
