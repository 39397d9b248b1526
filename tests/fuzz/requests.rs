//! Every method of the API with random messages, made from its descriptor and damaged: the daemon answers each, with no code of a bug.

use crate::random::{Random, damaged};
use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FileDescriptorSet};
use remesh_client::{Channel, Client, EditingSession, Source, v1};
use remesh_server::{ServerConfig, in_process};
use std::collections::{BTreeMap, HashMap};
use std::time::{Duration, Instant};
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::codegen::http::uri::PathAndQuery;
use tonic::{Code, Request, Status};

/// Bytes as they are.
#[derive(Debug, Clone, Default)]
struct Raw;

impl Codec for Raw {
    type Encode = Vec<u8>;
    type Decode = ();
    type Encoder = Raw;
    type Decoder = Raw;

    fn encoder(&mut self) -> Raw {
        Raw
    }

    fn decoder(&mut self) -> Raw {
        Raw
    }
}

impl Encoder for Raw {
    type Item = Vec<u8>;
    type Error = Status;

    fn encode(&mut self, item: Vec<u8>, to: &mut EncodeBuf<'_>) -> Result<(), Status> {
        bytes::BufMut::put_slice(to, &item);
        Ok(())
    }
}

impl Decoder for Raw {
    type Item = ();
    type Error = Status;

    fn decode(&mut self, from: &mut DecodeBuf<'_>) -> Result<Option<()>, Status> {
        let rest = bytes::Buf::remaining(from);
        bytes::Buf::advance(from, rest);
        Ok(Some(()))
    }
}

struct Api {
    messages: HashMap<String, DescriptorProto>,
    /// Path and input type of each method.
    methods: Vec<(String, String)>,
}

fn api() -> Api {
    let set = FileDescriptorSet::decode(remesh_proto::FILE_DESCRIPTOR_SET).expect("descriptors");
    let mut api = Api { messages: HashMap::new(), methods: Vec::new() };
    for file in set.file {
        let package = file.package().to_owned();
        for message in file.message_type {
            api.messages.insert(format!(".{package}.{}", message.name()), message);
        }
        for service in file.service.iter().filter(|_| package == "remesh.v1") {
            for method in &service.method {
                api.methods.push((format!("/{package}.{}/{}", service.name(), method.name()), method.input_type().to_owned()));
            }
        }
    }
    api
}

fn varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Names that exist, for text fields.
struct Known {
    names: Vec<String>,
    file: Vec<u8>,
}

impl Api {
    /// A random message of a type, most fields left out.
    fn message(&self, kind: &str, depth: usize, known: &Known, random: &mut Random) -> Vec<u8> {
        let mut out = Vec::new();
        let Some(descriptor) = self.messages.get(kind) else { return out };
        for field in &descriptor.field {
            let name = field.name();
            let is_key = matches!(name, "session" | "name") || (depth == 0 && random.one_in(2));
            if depth > 5 || !(is_key || random.one_in(3)) {
                continue;
            }
            let many = if field.label() == Label::Repeated { 1 + random.below(4) } else { 1 };
            for _ in 0..many {
                self.field(field.number() as u64, field.r#type(), field.type_name(), depth, known, random, &mut out);
            }
        }
        out
    }

    fn field(&self, number: u64, kind: Type, type_name: &str, depth: usize, known: &Known, random: &mut Random, out: &mut Vec<u8>) {
        let numbers = [0, 1, 2, 3, 5, 17, 100, u64::from(u32::MAX), u64::MAX, 1 << 31, 1 << 40];
        match kind {
            Type::Double | Type::Fixed64 | Type::Sfixed64 => {
                let value = *random.pick(&[0.0, 1.0, -1.0, 0.5, 1e-300, 1e300, f64::NAN, f64::INFINITY, 30.0, 1.2]);
                varint(number << 3 | 1, out);
                out.extend_from_slice(&value.to_le_bytes());
            }
            Type::Float | Type::Fixed32 | Type::Sfixed32 => {
                varint(number << 3 | 5, out);
                out.extend_from_slice(&(random.next() as u32).to_le_bytes());
            }
            Type::String | Type::Bytes | Type::Message | Type::Group => {
                let value = match kind {
                    Type::String if random.one_in(6) => damaged(known.names[0].clone().into_bytes(), random),
                    Type::String => random.pick(&known.names).clone().into_bytes(),
                    Type::Bytes if random.one_in(2) => damaged(known.file.clone(), random),
                    Type::Bytes => (0..random.below(200)).map(|_| random.next() as u8).collect(),
                    _ => self.message(type_name, depth + 1, known, random),
                };
                varint(number << 3 | 2, out);
                varint(value.len() as u64, out);
                out.extend_from_slice(&value);
            }
            _ => {
                varint(number << 3, out);
                varint(if random.one_in(3) { *random.pick(&numbers) } else { random.below(8) as u64 }, out);
            }
        }
    }
}

async fn call(channel: &Channel, path: &str, body: Vec<u8>) -> Result<(), Status> {
    let mut grpc = tonic::client::Grpc::new(channel.clone());
    grpc.ready().await.map_err(|e| Status::unavailable(e.to_string()))?;
    let mut request = Request::new(tokio_stream::once(body));
    request.set_timeout(Duration::from_millis(200));
    let path: PathAndQuery = path.parse().expect("a path");
    let mut stream = grpc.streaming(request, path, Raw).await?.into_inner();
    while stream.message().await?.is_some() {}
    Ok(())
}

async fn session(client: &Client) -> String {
    let mut session = EditingSession::create(client, "fuzz").await.expect("session");
    let sample = v1::SampleSpec { kind: v1::SampleKind::Tube.into(), triangles: Some(300), ..Default::default() };
    session.import(Source::Sample(sample), v1::ImportOptions::default()).await.expect("import");
    let size = v1::SizeSpec { size: Some(v1::size_spec::Size::Triangles(200)) };
    session.apply(v1::change::Change::Size(size)).await.expect("size");
    session.name().to_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn random_messages_to_every_method_meet_no_bug() {
    let number = |name: &str, usual: u64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(usual);
    let (first, time) = (number("REMESH_FUZZ_SEED", 1), Duration::from_secs(number("REMESH_FUZZ_SECONDS", 10)));
    let mut config = ServerConfig::default();
    config.engine.max_faces = 2000;
    config.engine.threads = 1;
    config.engine.cache_bytes = 64 << 20;
    config.engine.max_sessions = 50;
    config.engine.max_ttl = Duration::from_secs(20);
    config.sweep_interval = Duration::from_secs(1);
    let channel = in_process(config).await.expect("serves");
    let client = Client::from_channel(channel.clone());
    let api = api();
    let (begin, mut count, mut codes) = (Instant::now(), 0u64, BTreeMap::<String, u64>::new());
    let mut name = session(&client).await;
    while begin.elapsed() < time {
        let seed = first.wrapping_mul(1 << 40).wrapping_add(count);
        let mut random = Random::new(seed);
        if client.get_session(&name).await.is_err() {
            name = session(&client).await;
        }
        let names =
            vec![name.clone(), format!("{name}/operations/1"), String::new(), "a".into(), format!("blobs/{:064}", 0), "method".into()];
        let known = Known { names, file: b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec() };
        let (path, kind) = random.pick(&api.methods);
        let body = api.message(kind, 0, &known, &mut random);
        let body = if random.one_in(4) { damaged(body, &mut random) } else { body };
        // A call ends soon after its deadline, whatever it is.
        let ended = tokio::time::timeout(Duration::from_secs(10), call(&channel, path, body)).await;
        let code = match ended.unwrap_or_else(|_| panic!("{path}, seed {seed}: does not end")) {
            Ok(()) => "Ok".to_owned(),
            Err(status) => {
                let bug = matches!(status.code(), Code::Internal | Code::Unknown | Code::DataLoss);
                // The transport says INTERNAL for what is no protobuf message, before it comes to us.
                let undecodable = status.message().contains("decode") || status.message().contains("invalid wire type");
                assert!(!bug || undecodable, "{path}, seed {seed}: {status:?}");
                if undecodable { "undecodable".to_owned() } else { format!("{:?}", status.code()) }
            }
        };
        *codes.entry(code).or_default() += 1;
        count += 1;
    }
    println!("fuzz: {count} messages to {} methods in {:.0} s, seed {first}: {codes:?}", api.methods.len(), begin.elapsed().as_secs_f64());
    client.capabilities().await.expect("the daemon is well");
    assert!(codes.contains_key("Ok") && codes.contains_key("InvalidArgument"), "{codes:?}");
}
