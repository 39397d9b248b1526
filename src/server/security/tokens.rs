//! Static bearer tokens. The file holds a name and the BLAKE3 hash of a token on each line, never a token.

use remesh_engine::EngineError;

/// The names of tokens by their hashes.
#[derive(Debug)]
pub(super) struct TokenTable(Vec<(blake3::Hash, String)>);

const MAX_NAME: usize = 64;

fn check_name(name: &str) -> Result<(), String> {
    let fits = |b: u8| b.is_ascii_alphanumeric() || b"._@-".contains(&b);
    if name.is_empty() || name.len() > MAX_NAME || !name.bytes().all(fits) {
        return Err(format!("{name:?} is no name: letters, digits and ._@- make one, at most {MAX_NAME}"));
    }
    Ok(())
}

impl TokenTable {
    /// Reads lines of `NAME HASH`; empty lines and those that begin with `#` say nothing. A name may have several tokens.
    pub(super) fn parse(file: &[u8]) -> Result<Self, String> {
        let text = std::str::from_utf8(file).map_err(|_| "is not UTF-8".to_owned())?;
        let mut table = Vec::new();
        for (number, line) in text.lines().enumerate() {
            let at = |what: String| format!("line {}: {what}", number + 1);
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let (name, hash) = line.split_once(char::is_whitespace).ok_or_else(|| at("a name and a hash are expected".into()))?;
            check_name(name).map_err(at)?;
            let hash = blake3::Hash::from_hex(hash.trim()).map_err(|_| at("the hash must be 64 hexadecimal digits".into()))?;
            table.push((hash, name.to_owned()));
        }
        Ok(TokenTable(table))
    }

    /// The name of a token. Hashes are compared in constant time, and all of them.
    pub(super) fn name_of(&self, token: &str) -> Option<&str> {
        let hash = blake3::hash(token.as_bytes());
        self.0.iter().fold(None, |found, (known, name)| if *known == hash { Some(name.as_str()) } else { found })
    }
}

/// A fresh token of 256 random bits, and the line for the file that makes it one of `name`.
///
/// # Errors
/// A name that is none; a system without randomness.
pub fn new_token(name: &str) -> Result<(String, String), String> {
    check_name(name)?;
    let mut random = [0u8; 32];
    getrandom::fill(&mut random).map_err(|e| EngineError::invariant(format!("no randomness for a token: {e}")).to_string())?;
    let token: String = random.iter().map(|byte| format!("{byte:02x}")).collect();
    let line = format!("{name} {}", blake3::hash(token.as_bytes()));
    Ok((token, line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_have_names_and_the_file_holds_no_token() {
        let (alice, line) = new_token("alice").expect("token");
        let (bob, other) = new_token("bob@x.org").expect("token");
        assert!(alice != bob && !line.contains(&alice));
        let table = TokenTable::parse(format!("# people\n\n{line}\n  {other}  \n").as_bytes()).expect("table");
        assert_eq!([table.name_of(&alice), table.name_of(&bob), table.name_of("")], [Some("alice"), Some("bob@x.org"), None]);
        assert_eq!(table.name_of(&alice[1..]), None);
    }

    #[test]
    fn what_is_wrong_in_the_file_is_told_with_its_line() {
        let line = new_token("a").expect("token").1;
        for (bad, expected) in [("alice", "line 2: a name and a hash"), ("alice 12", "line 2: the hash"), ("a/b 12", "line 2: \"a/b\"")] {
            let error = TokenTable::parse(format!("{line}\n{bad}\n").as_bytes()).expect_err(bad);
            assert!(error.starts_with(expected), "{error}");
        }
        assert!(new_token("").is_err() && new_token("a b").is_err());
    }
}
