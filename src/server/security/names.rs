//! The name in the certificate of a client.

use tokio_rustls::rustls::pki_types::CertificateDer;

/// Hexadecimal digits of a digest that stand for a certificate without a name.
const DIGEST_DIGITS: usize = 32;

/// `cert:` and the first DNS name of a certificate that was verified; its digest if it has none.
pub(super) fn of_certificate(certificate: &CertificateDer<'static>) -> String {
    let parsed = webpki::EndEntityCert::try_from(certificate).ok();
    let name = parsed.as_ref().and_then(|cert| cert.valid_dns_names().next());
    match name {
        Some(name) => format!("cert:{name}"),
        None => format!("cert:{}", &blake3::hash(certificate).to_hex()[..DIGEST_DIGITS]),
    }
}
