//! Small readers of .ply, .obj and .stl: positions and faces, all else is passed over. Faces of more than three corners
//! become fans.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "coordinates are rounded to f32; counts are checked; indices that do not fit name no vertex"
)]

use std::path::Path;

use kinora::glam::Vec3;

use super::bytes::invalid;
use crate::cli::error::CliError;

/// Splits faces into fans of corners.
struct Fans<'a> {
    path: &'a Path,
    positions: &'a [Vec3],
    corners: Vec<Vec3>,
}

impl Fans<'_> {
    fn add(&mut self, face: &[i64], place: impl std::fmt::Display) -> Result<(), CliError> {
        let (path, count) = (self.path, self.positions.len());
        let corner = |&i: &i64| {
            let found = usize::try_from(i).ok().and_then(|i| self.positions.get(i)).copied();
            found.ok_or_else(|| invalid(path, format!("{place}: vertex {i} of {count}")))
        };
        let face = face.iter().map(corner).collect::<Result<Vec<_>, _>>()?;
        for pair in face.get(1..).unwrap_or_default().windows(2) {
            self.corners.extend([face[0], pair[0], pair[1]]);
        }
        Ok(())
    }
}

/// Wavefront OBJ: `v` and `f` lines; indices from 1, or from the end when negative.
pub(super) fn obj(path: &Path, content: &[u8]) -> Result<Vec<Vec3>, CliError> {
    let text = String::from_utf8_lossy(content);
    let mut positions = Vec::new();
    let mut corners = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let place = format!("line {}", number + 1);
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f32> = words.map_while(|w| w.parse().ok()).take(3).collect();
                let &[x, y, z] = &numbers[..] else {
                    return Err(invalid(path, format!("{place}: expected three coordinates")));
                };
                positions.push(Vec3::new(x, y, z));
            }
            Some("f") => {
                let count = i64::try_from(positions.len()).unwrap_or(i64::MAX);
                let index = |word: &str| {
                    let first = word.split('/').next().unwrap_or_default();
                    let index: i64 =
                        first.parse().map_err(|_| invalid(path, format!("{place}: `{word}` is no index")))?;
                    Ok(if index < 0 { count.saturating_add(index) } else { index - 1 })
                };
                let face = words.map(index).collect::<Result<Vec<_>, CliError>>()?;
                let mut fans = Fans { path, positions: &positions, corners };
                fans.add(&face, &place)?;
                corners = fans.corners;
            }
            _ => {}
        }
    }
    Ok(corners)
}

/// STL: binary when the length fits its count, else text.
pub(super) fn stl(path: &Path, content: &[u8]) -> Result<Vec<Vec3>, CliError> {
    if let Some((head, rest)) = content.split_at_checked(84) {
        let count = u32::from_le_bytes([head[80], head[81], head[82], head[83]]) as usize;
        if count.checked_mul(50) == Some(rest.len()) {
            let number = |f: &[u8], i: usize| f32::from_le_bytes([f[i], f[i + 1], f[i + 2], f[i + 3]]);
            let corner = |f: &[u8], i: usize| Vec3::new(number(f, i), number(f, i + 4), number(f, i + 8));
            let facets = rest.as_chunks::<50>().0.iter();
            return Ok(facets.flat_map(|f| [corner(f, 12), corner(f, 24), corner(f, 36)]).collect());
        }
    }
    let text = std::str::from_utf8(content).ok().filter(|t| t.trim_start().starts_with("solid"));
    let Some(text) = text else {
        return Err(invalid(path, "neither a text STL nor a binary one of the length that its count asks for"));
    };
    let mut corners = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        if words.next() == Some("vertex") {
            let numbers: Vec<f32> = words.map_while(|w| w.parse().ok()).collect();
            let &[x, y, z] = &numbers[..] else {
                return Err(invalid(path, format!("line {}: expected three coordinates", number + 1)));
            };
            corners.push(Vec3::new(x, y, z));
        }
    }
    if corners.len() % 3 != 0 {
        return Err(invalid(path, format!("{} vertices are not three a facet", corners.len())));
    }
    Ok(corners)
}

/// A number type of PLY.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }
}

struct Property {
    name: String,
    /// Type of the count before a list.
    list: Option<Kind>,
    kind: Kind,
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Text,
    Little,
    Big,
}

/// Values of a PLY body, one after the other.
struct Values<'a> {
    encoding: Encoding,
    rest: &'a [u8],
}

impl Values<'_> {
    fn next(&mut self, kind: Kind) -> Option<f64> {
        if self.encoding == Encoding::Text {
            let word = self.rest.trim_ascii_start();
            let end = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
            self.rest = &word[end..];
            return std::str::from_utf8(&word[..end]).ok()?.parse().ok();
        }
        Some(match kind {
            Kind::I8 => f64::from(i8::from_le_bytes(self.take()?)),
            Kind::U8 => f64::from(u8::from_le_bytes(self.take()?)),
            Kind::I16 => f64::from(i16::from_le_bytes(self.take()?)),
            Kind::U16 => f64::from(u16::from_le_bytes(self.take()?)),
            Kind::I32 => f64::from(i32::from_le_bytes(self.take()?)),
            Kind::U32 => f64::from(u32::from_le_bytes(self.take()?)),
            Kind::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Kind::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    /// The next bytes, little-endian.
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (&head, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        let mut head = head;
        if self.encoding == Encoding::Big {
            head.reverse();
        }
        Some(head)
    }
}

/// PLY: `x y z` of `vertex`, the list of `face`; text and both byte orders.
pub(super) fn ply(path: &Path, content: &[u8]) -> Result<Vec<Vec3>, CliError> {
    let (encoding, elements, rest) = ply_header(content).map_err(|reason| invalid(path, reason))?;
    let mut values = Values { encoding, rest };
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    for element in &elements {
        let place = |i: usize| format!("{} {i} of {}", element.name, element.count);
        if element.properties.is_empty() {
            return Err(invalid(path, format!("element `{}` has no properties", element.name)));
        }
        for i in 0..element.count {
            let ended = || invalid(path, format!("{}: the file ends or holds no number", place(i)));
            let mut position = [0.0; 3];
            for property in &element.properties {
                let count = match property.list {
                    Some(kind) => values.next(kind).ok_or_else(ended)?,
                    None => 1.0,
                };
                if !(0.0..=1e9).contains(&count) {
                    return Err(invalid(path, format!("{}: a list of {count}", place(i))));
                }
                let is_face = element.name == "face" && property.list.is_some();
                let mut face = Vec::new();
                for _ in 0..count as usize {
                    let value = values.next(property.kind).ok_or_else(ended)?;
                    if is_face {
                        face.push(value as i64);
                    } else if let Some(axis) = ["x", "y", "z"].iter().position(|&n| n == property.name) {
                        position[axis] = value as f32;
                    }
                }
                if is_face && property.name.starts_with("vertex_ind") {
                    faces.push(face);
                }
            }
            if element.name == "vertex" {
                positions.push(Vec3::from_array(position));
            }
        }
    }
    let mut fans = Fans { path, positions: &positions, corners: Vec::with_capacity(3 * faces.len()) };
    for (i, face) in faces.iter().enumerate() {
        fans.add(face, format_args!("face {i}"))?;
    }
    Ok(fans.corners)
}

type Header<'a> = (Encoding, Vec<Element>, &'a [u8]);

fn ply_header(content: &[u8]) -> Result<Header<'_>, String> {
    let mut rest = content;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 1.. {
        let end = rest.iter().position(|&b| b == b'\n').ok_or("the header has no end")?;
        let line = String::from_utf8_lossy(&rest[..end]).trim_end().to_owned();
        rest = &rest[end + 1..];
        let odd = || format!("line {number}: `{line}` is not understood");
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err("does not begin with `ply`".into()),
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Text,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(odd()),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| odd())?;
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", "list", count, kind, name] => {
                let list = Some(Kind::parse(count).ok_or_else(odd)?);
                let property = Property { name: name.to_owned(), list, kind: Kind::parse(kind).ok_or_else(odd)? };
                elements.last_mut().ok_or_else(odd)?.properties.push(property);
            }
            ["property", kind, name] => {
                let property = Property { name: name.to_owned(), list: None, kind: Kind::parse(kind).ok_or_else(odd)? };
                elements.last_mut().ok_or_else(odd)?.properties.push(property);
            }
            ["end_header"] => return Ok((encoding.ok_or("the header names no format")?, elements, rest)),
            _ => {}
        }
    }
    Err("the header has no end".into())
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;

    fn path() -> &'static Path {
        Path::new("mesh")
    }

    const SQUARE: [Vec3; 6] = {
        let (a, b) = (Vec3::ZERO, Vec3::new(1.0, 0.0, 0.0));
        let (c, d) = (Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
        [a, b, c, a, c, d]
    };

    #[test]
    fn obj_faces_become_fans_and_indices_may_count_from_the_end() {
        let text = "# square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1/1 2//2 -2 -1\n";
        assert_eq!(obj(path(), text.as_bytes()).expect("valid"), SQUARE);
        let error = obj(path(), b"v 0 0 0\nf 1 2 3\n").expect_err("vertex 2 of 1").to_string();
        assert_eq!(error, "mesh: line 2: vertex 1 of 1");
    }

    #[test]
    fn ply_text_and_both_byte_orders_agree() {
        let header = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\ncomment c\nelement vertex 4\nproperty float x\nproperty float y\n\
                 property double z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
            )
        };
        let text = header("ascii") + "0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n";
        assert_eq!(ply(path(), text.as_bytes()).expect("valid"), SQUARE);
        for big in [false, true] {
            let mut file = header(if big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
            let mut put = |mut bytes: Vec<u8>| {
                if big {
                    bytes.reverse();
                }
                file.extend(bytes);
            };
            for corner in [SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[5]] {
                put(corner.x.to_le_bytes().to_vec());
                put(corner.y.to_le_bytes().to_vec());
                put(f64::from(corner.z).to_le_bytes().to_vec());
                put(vec![9]);
            }
            put(vec![4]);
            (0..4_i32).for_each(|i| put(i.to_le_bytes().to_vec()));
            assert_eq!(ply(path(), &file).expect("valid"), SQUARE);
            let error = ply(path(), &file[..file.len() - 1]).expect_err("one byte short").to_string();
            assert_eq!(error, "mesh: face 0 of 1: the file ends or holds no number");
        }
    }

    #[test]
    fn stl_text_and_binary_agree() {
        let mut text = "solid s\n".to_owned();
        let mut binary = vec![b' '; 80];
        binary.extend(2_u32.to_le_bytes());
        for facet in SQUARE.chunks(3) {
            text += "facet normal 0 0 1\nouter loop\n";
            binary.extend([0; 12]);
            for corner in facet {
                writeln!(text, "vertex {} {} {}", corner.x, corner.y, corner.z).expect("strings take all");
                corner.to_array().iter().for_each(|c| binary.extend(c.to_le_bytes()));
            }
            text += "endloop\nendfacet\n";
            binary.extend([0; 2]);
        }
        assert_eq!(stl(path(), text.as_bytes()).expect("valid"), SQUARE);
        assert_eq!(stl(path(), &binary).expect("valid"), SQUARE);
        assert!(stl(path(), &binary[..100]).is_err());
    }
}
