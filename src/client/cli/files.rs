//! Files on the client's side: reading, writing by temporary file and rename, formats by extension.

use super::args::Encoding;
use super::failure::{Failure, Outcome};
use super::specs;
use crate::v1::{MeshEncoding, MeshFormat};
use bytes::Bytes;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Reads a whole file.
pub(crate) fn read(path: &Path) -> Outcome<Bytes> {
    if path.is_dir() {
        return Err(Failure::read(path, std::io::Error::other("it is a directory")));
    }
    fs::read(path).map(Bytes::from).map_err(|cause| Failure::read(path, cause))
}

/// A place that a file will be written to: checked before the work starts, so that an hour is not lost to a typing error.
#[derive(Debug, Clone)]
pub(crate) struct Target {
    path: PathBuf,
}

impl Target {
    /// Checks that `path` can name a new file and is none of the `inputs`.
    pub(crate) fn new(path: &Path, inputs: &[&Path]) -> Outcome<Self> {
        let same = |input: &Path| match (fs::canonicalize(path), fs::canonicalize(input)) {
            (Ok(a), Ok(b)) => a == b,
            _ => path == input,
        };
        if inputs.iter().any(|input| same(input)) {
            return Err(Failure::Usage(format!("{} is the input; the output needs another name", path.display())));
        }
        if path.file_name().is_none() || path.is_dir() {
            return Err(Failure::write(path, std::io::Error::other("it is not the name of a file")));
        }
        if !directory(path).is_dir() {
            return Err(Failure::write(path, std::io::Error::other(format!("there is no directory {}", directory(path).display()))));
        }
        Ok(Target { path: path.to_owned() })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file beside its place, then renames it: nobody ever sees half a file.
    pub(crate) fn write(&self, bytes: &[u8]) -> Outcome<()> {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let temporary = directory(&self.path).join(format!(".{name}.{}.part", std::process::id()));
        let written = fs::File::create(&temporary)
            .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
            .and_then(|()| fs::rename(&temporary, &self.path));
        written.map_err(|cause| {
            // What remains is of no use; that it cannot be removed either would only hide the cause.
            let _ = fs::remove_file(&temporary);
            Failure::write(&self.path, cause)
        })
    }
}

fn directory(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Format and encoding of a mesh file by its extension.
pub(crate) fn output_format(path: &Path, encoding: Option<Encoding>) -> Outcome<(MeshFormat, MeshEncoding)> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let format = match extension.as_str() {
        "stl" => MeshFormat::Stl,
        "obj" => MeshFormat::Obj,
        "ply" => MeshFormat::Ply,
        "off" => MeshFormat::Off,
        "msh" => MeshFormat::Msh,
        "gltf" | "glb" => MeshFormat::Gltf,
        "vtu" => MeshFormat::Vtu,
        _ => {
            let known = "stl, obj, ply, off, msh, gltf, glb or vtu";
            return Err(Failure::Usage(format!("the extension of {} tells no format: use {known}", path.display())));
        }
    };
    let encoding = match (extension.as_str(), encoding) {
        ("gltf", None) => MeshEncoding::Ascii,
        ("glb", None) => MeshEncoding::Binary,
        ("gltf", Some(Encoding::Binary)) | ("glb", Some(Encoding::Ascii)) => {
            return Err(Failure::Usage("binary glTF is .glb, text is .gltf".into()));
        }
        (_, Some(Encoding::Msh22)) if format != MeshFormat::Msh => {
            return Err(Failure::Usage("--encoding msh22 is for .msh files".into()));
        }
        (_, encoding) => specs::encoding(encoding),
    };
    Ok((format, encoding))
}

/// The words of a text file with their lines; `#` starts a comment.
fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate();
    lines.flat_map(|(index, line)| line.split('#').next().unwrap_or_default().split_whitespace().map(move |word| (index + 1, word)))
}

fn read_text(path: &Path) -> Outcome<String> {
    fs::read_to_string(path).map_err(|cause| Failure::read(path, cause))
}

fn malformed(path: &Path, line: usize, what: &str) -> Failure {
    Failure::read(path, std::io::Error::other(format!("line {line}: {what}")))
}

/// Positive numbers separated by blanks or line ends.
pub(crate) fn read_numbers(path: &Path) -> Outcome<Vec<f64>> {
    let text = read_text(path)?;
    let number = |(line, word): (usize, &str)| match word.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(malformed(path, line, &format!("'{word}' is not a positive number"))),
    };
    words(&text).map(number).collect()
}

/// Points one after another, with a number each where the file has a fourth column.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Polyline {
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) radii: Vec<f64>,
}

/// Polylines: a point `x y z` or `x y z radius` on each line, a blank line between two polylines.
pub(crate) fn read_polylines(path: &Path) -> Outcome<Vec<Polyline>> {
    let text = read_text(path)?;
    let mut lines = vec![Polyline::default()];
    for (at, row) in text.lines().enumerate() {
        let bad = |what: &str| malformed(path, at + 1, what);
        let numbers: Vec<f64> = row.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect();
        if numbers.iter().any(|x| !x.is_finite()) {
            return Err(bad("not only finite numbers"));
        }
        let Some(line) = lines.last_mut() else { continue };
        match numbers[..] {
            [] if line.points.is_empty() => {}
            [] => lines.push(Polyline::default()),
            [x, y, z] if line.radii.is_empty() => line.points.push([x, y, z]),
            [x, y, z, radius] if line.radii.len() == line.points.len() => {
                line.points.push([x, y, z]);
                line.radii.push(radius);
            }
            [_, _, _] | [_, _, _, _] => return Err(bad("a radius on some points of a polyline only")),
            _ => return Err(bad("not a point x y z, or x y z radius")),
        }
    }
    lines.retain(|line| !line.points.is_empty());
    Ok(lines)
}

/// Numbers of any sign.
pub(crate) fn read_signed_numbers(path: &Path) -> Outcome<Vec<f64>> {
    let text = read_text(path)?;
    let number = |(line, word): (usize, &str)| match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(malformed(path, line, &format!("'{word}' is not a number"))),
    };
    words(&text).map(number).collect()
}

/// Numbers of faces.
pub(crate) fn read_indices(path: &Path) -> Outcome<Vec<u32>> {
    let text = read_text(path)?;
    let index =
        |(line, word): (usize, &str)| word.parse::<u32>().map_err(|_| malformed(path, line, &format!("'{word}' is not a face number")));
    words(&text).map(index).collect()
}

/// Pairs of vertex numbers.
pub(crate) fn read_edges(path: &Path) -> Outcome<Vec<[u32; 2]>> {
    let text = read_text(path)?;
    let index =
        |(line, word): (usize, &str)| word.parse::<u32>().map_err(|_| malformed(path, line, &format!("'{word}' is not a vertex number")));
    let flat: Vec<u32> = words(&text).map(index).collect::<Outcome<_>>()?;
    if !flat.len().is_multiple_of(2) {
        return Err(malformed(path, text.lines().count(), "an edge with one vertex"));
    }
    Ok(flat.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
}

/// The name of a file without its directory, for messages.
pub(crate) fn short_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let directory = std::env::temp_dir().join(format!("remesh-files-{}-{name}", std::process::id()));
        fs::create_dir_all(&directory).expect("a temporary directory");
        directory
    }

    #[test]
    fn formats_follow_extensions() {
        let format = |name: &str, encoding| output_format(Path::new(name), encoding).map_err(|e| e.exit_code());
        assert_eq!(format("a/B.STL", None), Ok((MeshFormat::Stl, MeshEncoding::Unspecified)));
        assert_eq!(format("a.msh", Some(Encoding::Msh22)), Ok((MeshFormat::Msh, MeshEncoding::Msh22)));
        assert_eq!(format("a.gltf", None), Ok((MeshFormat::Gltf, MeshEncoding::Ascii)));
        assert_eq!(format("a.glb", None), Ok((MeshFormat::Gltf, MeshEncoding::Binary)));
        for (name, encoding) in
            [("a", None), ("a.step", None), ("a.stl", Some(Encoding::Msh22)), ("a.glb", Some(Encoding::Ascii)), (".stl", None)]
        {
            assert_eq!(format(name, encoding), Err(2), "{name}");
        }
    }

    #[test]
    fn the_input_is_never_overwritten() {
        let directory = scratch("input");
        let input = directory.join("a.stl");
        fs::write(&input, b"x").expect("written");
        let other_spelling = directory.join(".").join("a.stl");
        assert_eq!(Target::new(&other_spelling, &[&input]).expect_err("the same file").exit_code(), 2);
        assert!(Target::new(&directory.join("no/such/b.stl"), &[&input]).is_err());
        assert!(Target::new(&directory, &[&input]).is_err(), "a directory");
        let target = Target::new(&directory.join("b.stl"), &[&input]).expect("another file");
        target.write(b"first").expect("written");
        target.write(b"second").expect("replaced");
        assert_eq!(fs::read(target.path()).expect("read"), b"second");
        assert_eq!(fs::read_dir(&directory).expect("listed").count(), 2, "no temporary file stays");
        fs::remove_dir_all(&directory).expect("removed");
    }

    #[test]
    fn numbers_and_edges_are_read() {
        let directory = scratch("numbers");
        let file = directory.join("n.txt");
        let with = |text: &str| fs::write(&file, text).expect("written");
        with("# sizes\n1 2.5\n\n1e-3 # last\n");
        assert_eq!(read_numbers(&file).expect("numbers"), [1.0, 2.5, 1e-3]);
        with("1\n-2\n");
        assert!(read_numbers(&file).expect_err("negative").to_string().contains("line 2: '-2'"));
        with("0 1\n1 2\n");
        assert_eq!(read_edges(&file).expect("edges"), [[0, 1], [1, 2]]);
        with("0 1 2");
        assert!(read_edges(&file).is_err());
        fs::remove_dir_all(&directory).expect("removed");
        assert!(read(&directory.join("absent")).expect_err("absent").to_string().contains("absent"));
    }
}
