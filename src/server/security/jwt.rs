//! Bearer tokens that somebody else signs (JWT). Only signatures with public keys: a file of the server never lets anybody sign.

use jsonwebtoken::jwk::{AlgorithmParameters, JwkSet};
use jsonwebtoken::{AlgorithmFamily, DecodingKey, Validation, errors::ErrorKind};
use serde::Deserialize;

/// Difference of clocks that is overlooked.
const LEEWAY_SECONDS: u64 = 30;
const MAX_SUBJECT: usize = 128;

/// The keys and what tokens must say.
pub(super) struct JwtKeys {
    keys: Vec<(Option<String>, DecodingKey)>,
    issuer: Option<String>,
    audience: Option<String>,
}

impl std::fmt::Debug for JwtKeys {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("JwtKeys").field("keys", &self.keys.len()).field("issuer", &self.issuer).field("audience", &self.audience).finish()
    }
}

/// Why a token is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    /// It was good once.
    Expired,
    /// Anything else; a caller is not told what.
    Invalid,
}

/// What is read of a token. Both are required and must have the right type.
#[derive(Debug, Deserialize)]
struct Claims {
    sub: String,
    #[serde(rename = "exp")]
    _exp: u64,
}

impl JwtKeys {
    /// Keys from a JWK set, or from one or more public keys in PEM.
    pub(super) fn parse(file: &[u8], issuer: Option<&str>, audience: Option<&str>) -> Result<Self, String> {
        let text = std::str::from_utf8(file).map_err(|_| "is not UTF-8".to_owned())?;
        let keys = if text.trim_start().starts_with('{') { of_set(text)? } else { of_pem(text)? };
        if keys.is_empty() {
            return Err("holds no key".to_owned());
        }
        Ok(JwtKeys { keys, issuer: issuer.map(str::to_owned), audience: audience.map(str::to_owned) })
    }

    /// Who a token was made for.
    pub(super) fn subject_of(&self, token: &str) -> Result<String, Refusal> {
        let header = jsonwebtoken::decode_header(token).map_err(|_| Refusal::Invalid)?;
        let mut validation = Validation::new(header.alg);
        validation.leeway = LEEWAY_SECONDS;
        validation.validate_nbf = true;
        validation.set_required_spec_claims(&["exp", "sub"]);
        match &self.audience {
            Some(audience) => {
                validation.set_audience(&[audience]);
                validation.required_spec_claims.insert("aud".to_owned());
            }
            None => validation.validate_aud = false,
        }
        if let Some(issuer) = &self.issuer {
            validation.set_issuer(&[issuer]);
            validation.required_spec_claims.insert("iss".to_owned());
        }
        let mut refusal = Refusal::Invalid;
        let of_kind = |key: &DecodingKey| key.family() != AlgorithmFamily::Hmac && key.family().algorithms().contains(&header.alg);
        let named = |id: &Option<String>| id.is_none() || header.kid.is_none() || *id == header.kid;
        for (_, key) in self.keys.iter().filter(|(id, key)| named(id) && of_kind(key)) {
            match jsonwebtoken::decode::<Claims>(token, key, &validation) {
                Ok(data) => return checked(data.claims.sub),
                Err(error) if matches!(error.kind(), ErrorKind::ExpiredSignature) => refusal = Refusal::Expired,
                Err(_) => {}
            }
        }
        Err(refusal)
    }
}

fn checked(subject: String) -> Result<String, Refusal> {
    let fits = !subject.is_empty() && subject.len() <= MAX_SUBJECT && !subject.chars().any(char::is_control);
    if fits { Ok(subject) } else { Err(Refusal::Invalid) }
}

fn of_set(text: &str) -> Result<Vec<(Option<String>, DecodingKey)>, String> {
    let set: JwkSet = serde_json::from_str(text).map_err(|error| format!("is no JWK set: {error}"))?;
    let mut keys = Vec::new();
    for jwk in &set.keys {
        let id = jwk.common.key_id.clone();
        let name = id.as_deref().unwrap_or("without an id");
        if matches!(jwk.algorithm, AlgorithmParameters::OctetKey(_)) {
            return Err(format!("key {name} is a secret; only public keys are taken"));
        }
        let key = DecodingKey::from_jwk(jwk).map_err(|error| format!("key {name}: {error}"))?;
        keys.push((id, key));
    }
    Ok(keys)
}

const END: &str = "-----END PUBLIC KEY-----";

fn of_pem(text: &str) -> Result<Vec<(Option<String>, DecodingKey)>, String> {
    let mut keys = Vec::new();
    for (number, block) in text.split_inclusive(END).filter(|block| !block.trim().is_empty()).enumerate() {
        let bytes = block.trim().as_bytes();
        let kinds = [DecodingKey::from_ed_pem, DecodingKey::from_ec_pem, DecodingKey::from_rsa_pem];
        let key = kinds.into_iter().find_map(|read| read(bytes).ok());
        keys.push((None, key.ok_or_else(|| format!("key {} is no public key (PEM, Ed25519, P-256, P-384 or RSA)", number + 1))?));
    }
    Ok(keys)
}

#[cfg(test)]
mod tests {
    use super::*;
    use jsonwebtoken::{Algorithm, EncodingKey, Header, encode, get_current_timestamp};
    use rcgen::{KeyPair, PKCS_ECDSA_P256_SHA256, PKCS_ED25519};
    use serde_json::json;

    fn token(key: &KeyPair, algorithm: Algorithm, claims: &serde_json::Value) -> String {
        let der = key.serialize_der();
        let key = if algorithm == Algorithm::EdDSA { EncodingKey::from_ed_der(&der) } else { EncodingKey::from_ec_der(&der) };
        encode(&Header::new(algorithm), claims, &key).expect("signed")
    }

    fn pem(key: &KeyPair) -> String {
        key.public_key_pem()
    }

    #[test]
    fn good_tokens_have_a_subject_and_others_are_refused() {
        let edwards = KeyPair::generate_for(&PKCS_ED25519).expect("key");
        let curve = KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256).expect("key");
        let stranger = KeyPair::generate_for(&PKCS_ED25519).expect("key");
        let keys = JwtKeys::parse((pem(&edwards) + &pem(&curve)).as_bytes(), Some("idp"), Some("remeshd")).expect("keys");
        let now = get_current_timestamp();
        let good = json!({ "sub": "alice", "exp": now + 60, "iss": "idp", "aud": "remeshd" });
        assert_eq!(keys.subject_of(&token(&edwards, Algorithm::EdDSA, &good)), Ok("alice".to_owned()));
        assert_eq!(keys.subject_of(&token(&curve, Algorithm::ES256, &good)), Ok("alice".to_owned()));
        assert_eq!(keys.subject_of(&token(&stranger, Algorithm::EdDSA, &good)), Err(Refusal::Invalid));
        let with = |key: &str, value: serde_json::Value| {
            let mut claims = good.clone();
            claims[key] = value;
            keys.subject_of(&token(&edwards, Algorithm::EdDSA, &claims))
        };
        assert_eq!(with("exp", json!(now - 3600)), Err(Refusal::Expired));
        for (key, value) in [
            ("exp", json!("never")),
            ("exp", json!(null)),
            ("nbf", json!(now + 3600)),
            ("nbf", json!("soon")),
            ("iss", json!("other")),
            ("iss", json!(null)),
            ("aud", json!("other")),
            ("aud", json!(null)),
            ("sub", json!("")),
            ("sub", json!(7)),
            ("sub", json!("a\nb")),
            ("sub", json!("x".repeat(200))),
        ] {
            assert_eq!(with(key, value.clone()), Err(Refusal::Invalid), "{key} {value}");
        }
        // The public key is no secret to sign with.
        let forged = encode(&Header::new(Algorithm::HS256), &good, &EncodingKey::from_secret(pem(&edwards).as_bytes())).expect("signed");
        assert_eq!(keys.subject_of(&forged), Err(Refusal::Invalid));
        for nonsense in ["", "a.b.c", "..", "eyJhbGciOiJub25lIn0.e30."] {
            assert_eq!(keys.subject_of(nonsense), Err(Refusal::Invalid), "{nonsense}");
        }
    }

    #[test]
    fn files_without_public_keys_are_refused() {
        for (file, expected) in [
            ("", "holds no key"),
            ("hello", "key 1 is no public key"),
            ("{\"keys\": []}", "holds no key"),
            ("{", "is no JWK set"),
            (r#"{"keys": [{"kty": "oct", "k": "c2VjcmV0", "kid": "s"}]}"#, "key s is a secret"),
        ] {
            let error = JwtKeys::parse(file.as_bytes(), None, None).expect_err(file);
            assert!(error.contains(expected), "{file}: {error}");
        }
    }
}
