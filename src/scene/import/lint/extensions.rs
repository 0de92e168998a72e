//! Extensions: declared twice, required but not declared, used but not declared.

use std::{borrow::Cow, cell::RefCell, collections::BTreeSet, fmt};

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};

use super::super::context::Context;

/// Most names that are collected, and most characters of each.
const MAX_NAMES: usize = 1000;
const MAX_LENGTH: usize = 200;

pub(super) fn check(cx: &Context<'_>) {
    for (member, list) in
        [("extensionsUsed", &cx.doc.extensions_used), ("extensionsRequired", &cx.doc.extensions_required)]
    {
        let mut seen = BTreeSet::new();
        for name in list.iter().filter(|name| !seen.insert(name.as_str())) {
            cx.warnings.add(member, format_args!("names {} twice", name.escape_debug()));
        }
    }
    for name in cx.doc.extensions_required.iter().filter(|name| !cx.doc.uses(name)) {
        let text = format!("names {}, which extensionsUsed does not", name.escape_debug());
        cx.warnings.add("extensionsRequired", text);
    }
}

/// Names of extension objects in the text that `extensionsUsed` does not list, in alphabetical order.
pub(in super::super) fn undeclared(cx: &Context<'_>, text: &str) -> Vec<String> {
    let names = RefCell::new(BTreeSet::new());
    let mut json = serde_json::Deserializer::from_str(text);
    // Too deeply nested parts (legal in `extras`) end the search early; it only feeds warnings.
    let _ = Walk { names: &names, in_extensions: false }.deserialize(&mut json);
    let mut names: Vec<String> = names.into_inner().into_iter().collect();
    names.retain(|name| !cx.doc.uses(name));
    for name in &names {
        let text = format!("does not list {}, which the file uses", name.escape_debug());
        cx.warnings.add("extensionsUsed", text);
    }
    names
}

/// Walks JSON text and collects the names in every `extensions` object.
#[derive(Clone, Copy)]
struct Walk<'n> {
    names: &'n RefCell<BTreeSet<String>>,
    in_extensions: bool,
}

impl<'de> DeserializeSeed<'de> for Walk<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, d: D) -> Result<(), D::Error> {
        d.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Walk<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<Key<'de>>()? {
            if self.in_extensions {
                let mut names = self.names.borrow_mut();
                if names.len() < MAX_NAMES {
                    names.insert(key.0.chars().take(MAX_LENGTH).collect());
                }
            }
            if key.0 == "extras" {
                map.next_value::<serde::de::IgnoredAny>()?;
                continue;
            }
            let in_extensions = !self.in_extensions && key.0 == "extensions";
            map.next_value_seed(Walk { in_extensions, ..self })?;
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        while seq.next_element_seed(Walk { in_extensions: false, ..self })?.is_some() {}
        Ok(())
    }

    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_u64<E>(self, _: u64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }
}

/// A key, borrowed from the text where it has no escapes.
#[derive(serde::Deserialize)]
struct Key<'a>(#[serde(borrow)] Cow<'a, str>);
