//! Keys of records: everything of a session lies together, under its id.

/// When the daemon was last known to be alive.
pub(super) const ALIVE: &[u8] = b"alive";

/// Digits of the id of a session.
const ID_LEN: usize = 32;

/// What a record is of a session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    Session,
    Head,
    Revision,
    Part,
    Answer,
}

/// All records of a session begin so.
pub(super) fn all_of(id: &str) -> Vec<u8> {
    let mut key = b"s".to_vec();
    key.extend_from_slice(id.as_bytes());
    key
}

fn key(id: &str, kind: u8, rest: &[u8]) -> Vec<u8> {
    let mut key = all_of(id);
    key.push(kind);
    key.extend_from_slice(rest);
    key
}

/// What is no input.
pub(super) fn session(id: &str) -> Vec<u8> {
    key(id, b's', &[])
}

/// Where it is.
pub(super) fn head(id: &str) -> Vec<u8> {
    key(id, b'h', &[])
}

/// A revision.
pub(super) fn revision(id: &str, revision: u64) -> Vec<u8> {
    key(id, b'r', &revision.to_be_bytes())
}

/// A part.
pub(super) fn part(id: &str, part: &[u8; 16]) -> Vec<u8> {
    key(id, b'p', part)
}

/// The answer to a request that was carried out at a revision.
pub(super) fn answer(id: &str, revision: u64, request_id: &str) -> Vec<u8> {
    let mut rest = revision.to_be_bytes().to_vec();
    rest.extend_from_slice(request_id.as_bytes());
    key(id, b'a', &rest)
}

/// The session of a key and what it is of it; `None` for a key that is not of a session.
pub(super) fn read(key: &[u8]) -> Option<(&str, Kind)> {
    let (id, rest) = key.strip_prefix(b"s")?.split_at_checked(ID_LEN)?;
    let kind = match rest.first()? {
        b's' => Kind::Session,
        b'h' => Kind::Head,
        b'r' => Kind::Revision,
        b'p' => Kind::Part,
        b'a' => Kind::Answer,
        _ => return None,
    };
    Some((std::str::from_utf8(id).ok()?, kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_tell_what_they_are_of() {
        let id = "0123456789abcdef0123456789abcdef";
        let cases = [
            (session(id), Kind::Session),
            (head(id), Kind::Head),
            (revision(id, 7), Kind::Revision),
            (part(id, &[9; 16]), Kind::Part),
            (answer(id, 300, "x"), Kind::Answer),
        ];
        for (key, kind) in cases {
            assert!(key.starts_with(&all_of(id)));
            assert_eq!(read(&key), Some((id, kind)));
        }
        assert!(revision(id, 255) < revision(id, 256), "in order");
        assert_eq!((read(ALIVE), read(b"s"), read(&all_of(id))), (None, None, None));
    }
}
