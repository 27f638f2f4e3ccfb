//! Render vars (UsdRenderVar) to the AOVs and channels of a product's file.
//!
//! Hosts pass what is authored; what it means is decided here, once for all hosts:
//! * the source, by `sourceType`: `raw` and `intrinsic` name an AOV of this renderer, or what other
//!   renderers call it (`Ci`, `a`, `z`, `id`...); `primvar` names a primvar; of light path
//!   expressions only those of the whole image are known. Without a source the var's name is it.
//! * the pixel type, by `driver:parameters:aov:format`, else by `dataType`: `half3` and `color3h`
//!   have 16 bits, `float3` and `color3f` 32, and as many values are written as both the type and
//!   the AOV have. Without either the values are written as they are without a product.
//! * the channels' names: the first colour of a product is plainly `R G B A`, its alpha `A`; others
//!   are `name.X` and so on, the name being `driver:parameters:aov:channel_prefix` (where that is
//!   empty, there is no prefix), else `driver:parameters:aov:name`, else the prim's.

use std::collections::BTreeSet;

use hdtrapeze_core::diagnostics::{Code, Warning};

use crate::error::Error;
use crate::image::{ChannelData, Layer, Precision};

/// A render var as authored. Texts are empty where nothing is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RenderVar {
    /// Path of the prim.
    pub path: String,
    /// sourceName.
    pub source_name: String,
    /// sourceType.
    pub source_type: String,
    /// dataType, a USD type.
    pub data_type: String,
    /// driver:parameters:aov:format.
    pub format: String,
    /// driver:parameters:aov:name.
    pub name: String,
    /// driver:parameters:aov:channel_prefix, where it is authored.
    pub channel_prefix: Option<String>,
}

/// Where a var's values come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// Name of the AOV.
    pub aov: String,
    /// One component of it, or all.
    component: Option<usize>,
}

impl Source {
    /// True for primvars, which a scene may have or not.
    pub fn is_primvar(&self) -> bool {
        self.aov
            .strip_prefix("primvars:")
            .is_some_and(|name| !name.is_empty())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    Half,
    Float,
    Integer,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ValueType {
    components: usize,
    number: Number,
}

/// Names that other renderers have for AOVs: theirs, ours, and which component.
const ALIASES: &[(&str, &str, Option<usize>)] = &[
    ("Ci", "color", None),
    ("C", "color", None),
    ("rgba", "color", None),
    ("RGBA", "color", None),
    ("beauty", "color", None),
    ("a", "color", Some(3)),
    ("A", "color", Some(3)),
    ("alpha", "color", Some(3)),
    ("z", "cameraDepth", None),
    ("Z", "cameraDepth", None),
    ("N", "normal", None),
    ("Nn", "normal", None),
    ("id", "primId", None),
    ("id2", "instanceId", None),
    ("faceindex", "elementId", None),
    ("motionvector", "motionVectors", None),
];

/// Light path expressions of the whole image.
const WHOLE_IMAGE: &[&str] = &["C.*[<L.>O]", "C.*[LO]", "C.*<L.>", "C.*"];

/// USD's types that hold no numbers.
const WORDS: &[&str] = &["string", "token", "asset"];

impl RenderVar {
    /// Where the var's values come from, whether this renderer has it or not.
    ///
    /// # Errors
    /// A sentence about what is not supported.
    pub fn source(&self) -> Result<Source, String> {
        let name = match self.source_name.as_str() {
            "" => self.own_name(),
            name => name,
        };
        let whole = |aov: &str| Source {
            aov: aov.to_owned(),
            component: None,
        };
        match self.source_type.as_str() {
            "" | "raw" | "intrinsic" => {
                let alias = ALIASES.iter().find(|(theirs, ..)| *theirs == name);
                Ok(alias.map_or_else(
                    || whole(name),
                    |&(_, aov, component)| Source {
                        component,
                        ..whole(aov)
                    },
                ))
            }
            "primvar" => {
                let name = name.strip_prefix("primvars:").unwrap_or(name);
                Ok(whole(&format!("primvars:{name}")))
            }
            "lpe" if WHOLE_IMAGE.contains(&name) => Ok(whole("color")),
            "lpe" => Err(format!("the light path expression {name} is not supported")),
            other => Err(format!("its sourceType {other} is not known")),
        }
    }

    /// The prim's own name, or the one that it has as an AOV.
    fn own_name(&self) -> &str {
        match self.name.as_str() {
            "" => self.path.rsplit('/').next().unwrap_or_default(),
            name => name,
        }
    }

    /// A warning about a type that is not known; the values are then written as they are. A primvar of
    /// words has no such values, which is told where its AOV is decided.
    pub fn check_type(&self) -> Option<Warning> {
        let (what, name) = self.type_name()?;
        if self.source_type == "primvar" && WORDS.contains(&name) {
            return None;
        }
        let text = format!("its {what} {name} is not known; its values are written as they are");
        match value_type(name) {
            Some(_) => None,
            None => Some(Warning::new(&self.path, Code::Unsupported, text)),
        }
    }

    fn type_name(&self) -> Option<(&'static str, &str)> {
        let named = [("format", &self.format), ("dataType", &self.data_type)];
        let authored = named.into_iter().find(|(_, name)| !name.is_empty());
        authored.map(|(what, name)| (what, name.as_str()))
    }

    fn value_type(&self) -> Option<ValueType> {
        self.type_name().and_then(|(_, name)| value_type(name))
    }
}

/// A USD value type of numbers.
fn value_type(name: &str) -> Option<ValueType> {
    const ROLES: &[&str] = &["color", "point", "normal", "vector", "texCoord"];
    let word = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let digits = &name[word.len()..];
    let plain = match word {
        "half" => Some(Number::Half),
        "float" | "double" => Some(Number::Float),
        "int" | "uint" | "bool" | "uchar" => Some(Number::Integer),
        _ => None,
    };
    if let Some(number) = plain {
        let components = match (word, digits) {
            (_, "") | ("int" | "uint", "64") => 1,
            (_, digits) => digits.parse().ok().filter(|n| (2..=4).contains(n))?,
        };
        return Some(ValueType { components, number });
    }
    let role = ROLES.iter().find(|role| name.starts_with(**role))?;
    let mut rest = name[role.len()..].chars();
    let components = rest.next()?.to_digit(10)? as usize;
    let number = match rest.as_str() {
        "h" => Number::Half,
        "f" | "d" => Number::Float,
        _ => return None,
    };
    (2..=4)
        .contains(&components)
        .then_some(ValueType { components, number })
}

/// The layers of a product's file, in the order of its vars. `layer` gives an AOV as a layer.
/// A var whose channels are there already, or whose primvar no prim has, is left out, with a warning.
pub(crate) fn layers(
    vars: &[RenderVar],
    mut layer: impl FnMut(&str) -> Result<Layer, Error>,
) -> Result<(Vec<Layer>, Vec<Warning>), Error> {
    let mut layers = Vec::with_capacity(vars.len());
    let mut warnings = Vec::new();
    let mut taken = BTreeSet::new();
    let mut colors = 0;
    for var in vars {
        let source = var.source().map_err(Error::Unsupported)?;
        let mut layer = match layer(&source.aov) {
            Err(Error::NotFound(_)) if source.is_primvar() => {
                let text = format!("no prim has {}; left out", source.aov);
                warnings.push(Warning::new(&var.path, Code::Unsupported, text));
                continue;
            }
            layer => layer?,
        };
        if let Some(component) = source.component {
            layer.channels = layer.channels.into_iter().skip(component).take(1).collect();
        }
        if let Some(value) = var.value_type() {
            convert(&mut layer, value);
        }
        let is_color = source.aov == "color";
        let plain = match &var.channel_prefix {
            Some(prefix) => prefix.is_empty(),
            None if !is_color => false,
            None if source.component.is_some() => !taken.contains("A"),
            None => {
                colors += 1;
                colors == 1
            }
        };
        let prefix = match (&var.channel_prefix, plain) {
            (_, true) if is_color => "color",
            (_, true) => "",
            (Some(prefix), _) => prefix.trim_end_matches('.'),
            (None, _) => var.own_name(),
        };
        layer.name = prefix.to_owned();
        let names: Vec<String> = layer.channel_names().collect();
        if let Some(name) = names.iter().find(|name| taken.contains(*name)) {
            let text = format!("another var of its product has the channel {name}; left out");
            warnings.push(Warning::new(&var.path, Code::Unsupported, text));
            continue;
        }
        taken.extend(names);
        layers.push(layer);
    }
    Ok((layers, warnings))
}

/// Takes as many values as the type has, in its precision. Integers that do not fit into the type
/// of a real number have 32 bits; real numbers stay real.
fn convert(layer: &mut Layer, value: ValueType) {
    layer.channels.truncate(value.components.max(1));
    let mut precision = match value.number {
        Number::Half => Precision::Half,
        Number::Float | Number::Integer => Precision::Float,
    };
    for (_, data) in &mut layer.channels {
        if let (ChannelData::I32(ids), Number::Half | Number::Float) = (&*data, value.number) {
            *data = ChannelData::F32(ids.iter().map(|&id| id as f32).collect());
            precision = Precision::Float;
        }
    }
    layer.precision = precision;
}

/// The first var of colour: all that a PNG holds of a product.
pub(crate) fn picture(vars: &[RenderVar]) -> Result<&RenderVar, Error> {
    let is_color = |var: &&RenderVar| {
        var.source()
            .is_ok_and(|source| source.aov == "color" && source.component.is_none())
    };
    let none = || Error::InvalidArgument("a PNG holds color, which none of the vars is".to_owned());
    vars.iter().find(is_color).ok_or_else(none)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn var(path: &str, source: &str) -> RenderVar {
        RenderVar {
            path: path.to_owned(),
            source_name: source.to_owned(),
            ..RenderVar::default()
        }
    }

    fn typed(path: &str, source: &str, data_type: &str) -> RenderVar {
        RenderVar {
            data_type: data_type.to_owned(),
            ..var(path, source)
        }
    }

    fn layer_of(name: &str) -> Result<Layer, Error> {
        Ok(match name {
            "primvars:none" => return Err(Error::NotFound(name.to_owned())),
            "primId" => Layer::from_ids(name, vec![7]),
            "color" => Layer::from_interleaved(name, 4, &[0.1, 0.2, 0.3, 0.4]),
            "cameraDepth" => Layer::from_interleaved(name, 1, &[5.0]),
            _ => Layer::from_interleaved(name, 3, &[1.0, 2.0, 3.0]),
        })
    }

    /// Names and precision of what is written, and the paths that are warned about.
    fn written(vars: &[RenderVar]) -> (Vec<(String, Precision)>, Vec<String>) {
        let (layers, warnings) = layers(vars, layer_of).unwrap();
        let names = layers
            .iter()
            .flat_map(|layer| layer.channel_names().map(|name| (name, layer.precision)))
            .collect();
        (names, warnings.into_iter().map(|w| w.prim).collect())
    }

    fn names(vars: &[RenderVar]) -> String {
        let (names, _) = written(vars);
        let names: Vec<_> = names.into_iter().map(|(name, _)| name).collect();
        names.join(" ")
    }

    #[test]
    fn sources_have_many_names() {
        let aov = |v: &RenderVar| v.source().unwrap().aov;
        for (source, expected) in [
            ("color", "color"),
            ("Ci", "color"),
            ("a", "color"),
            ("z", "cameraDepth"),
            ("depth", "depth"),
            ("id", "primId"),
            ("primvars:st", "primvars:st"),
            ("nonsense", "nonsense"),
        ] {
            assert_eq!(aov(&var("/v", source)), expected);
        }
        assert_eq!(aov(&var("/Vars/Neye", "")), "Neye");
        let named = RenderVar {
            name: "P".to_owned(),
            ..var("/Vars/x", "")
        };
        assert_eq!(aov(&named), "P");
        let of_type = |kind: &str, source: &str| RenderVar {
            source_type: kind.to_owned(),
            ..var("/v", source)
        };
        assert_eq!(aov(&of_type("primvar", "st")), "primvars:st");
        assert_eq!(aov(&of_type("primvar", "primvars:st")), "primvars:st");
        assert_eq!(aov(&of_type("intrinsic", "P")), "P");
        assert_eq!(aov(&of_type("lpe", "C.*[<L.>O]")), "color");
        for (kind, source) in [("lpe", "C<RD>[<L.>O]"), ("magic", "color")] {
            let why = of_type(kind, source).source().unwrap_err();
            assert!(
                why.contains(if kind == "lpe" { source } else { kind }),
                "{why}"
            );
        }
    }

    #[test]
    fn channels_are_named_by_the_var() {
        assert_eq!(names(&[var("/v/beauty", "color")]), "R G B A");
        assert_eq!(
            names(&[
                var("/v/a", "color"),
                var("/v/b", "Ci"),
                var("/v/n", "normal")
            ]),
            "R G B A b.R b.G b.B b.A n.X n.Y n.Z"
        );
        assert_eq!(
            names(&[
                typed("/v/c", "color", "color3f"),
                typed("/v/alpha", "a", "float")
            ]),
            "R G B A"
        );
        assert_eq!(
            names(&[var("/v/c", "color"), typed("/v/alpha", "a", "float")]),
            "R G B A alpha.A"
        );
        let named = |name: &str, prefix: Option<&str>| RenderVar {
            name: name.to_owned(),
            channel_prefix: prefix.map(str::to_owned),
            ..var("/v/n", "normal")
        };
        assert_eq!(names(&[named("other", None)]), "other.X other.Y other.Z");
        assert_eq!(names(&[named("other", Some("p"))]), "p.X p.Y p.Z");
        assert_eq!(names(&[named("other", Some("p."))]), "p.X p.Y p.Z");
        assert_eq!(names(&[named("other", Some(""))]), "X Y Z");
    }

    #[test]
    fn types_decide_pixels() {
        let one = |data_type: &str, source: &str| written(&[typed("/v/x", source, data_type)]).0;
        let all = |names: &str, precision| {
            let names = names.split(' ').map(|name| (name.to_owned(), precision));
            names.collect::<Vec<_>>()
        };
        assert_eq!(one("", "color"), all("R G B A", Precision::File));
        assert_eq!(one("color3f", "color"), all("R G B", Precision::Float));
        assert_eq!(one("color4h", "color"), all("R G B A", Precision::Half));
        assert_eq!(one("half", "z"), all("x.Z", Precision::Half));
        assert_eq!(one("float2", "normal"), all("x.X x.Y", Precision::Float));
        assert_eq!(
            one("float4", "normal"),
            all("x.X x.Y x.Z", Precision::Float)
        );
        assert_eq!(one("int", "id"), all("x.X", Precision::Float));
        let formatted = RenderVar {
            format: "color3h".to_owned(),
            ..typed("/v/x", "color", "color4f")
        };
        assert_eq!(written(&[formatted]).0, all("R G B", Precision::Half));
        for good in [
            "normal3f",
            "texCoord2h",
            "point3d",
            "double3",
            "int64",
            "uint",
            "bool",
        ] {
            assert_eq!(typed("/v", "P", good).check_type(), None, "{good}");
        }
        for bad in [
            "banana",
            "color",
            "color9f",
            "float7",
            "color3q",
            "point",
            "color3\u{e9}",
        ] {
            let warning = typed("/v", "P", bad).check_type().unwrap();
            assert!(warning.prim == "/v" && warning.text.contains(bad), "{bad}");
        }
        let words = typed("/v", "label", "string");
        assert!(words.check_type().is_some());
        let primvar = RenderVar {
            source_type: "primvar".to_owned(),
            ..words
        };
        assert_eq!(primvar.check_type(), None);
    }

    #[test]
    fn ids_become_real_numbers_where_asked_for() {
        let ids = |data_type| {
            let vars = [typed("/v/id", "primId", data_type)];
            layers(&vars, layer_of).unwrap().0[0].channels[0].1.clone()
        };
        assert_eq!(ids("int"), ChannelData::I32(vec![7]));
        assert_eq!(ids(""), ChannelData::I32(vec![7]));
        assert_eq!(ids("float"), ChannelData::F32(vec![7.0]));
        assert_eq!(ids("half"), ChannelData::F32(vec![7.0]));
    }

    #[test]
    fn primvars_that_no_prim_has_are_left_out() {
        let (names, warned) = written(&[var("/v/x", "primvars:none"), var("/v/p", "P")]);
        assert_eq!((names.len(), warned), (3, vec!["/v/x".to_owned()]));
        assert!(!var("/v", "primvars:").source().unwrap().is_primvar());
    }

    #[test]
    fn channels_that_are_there_already_are_left_out() {
        let twice = [var("/a/n", "normal"), var("/b/n", "P"), var("/c/p", "P")];
        let (names, warned) = written(&twice);
        assert_eq!(names.len(), 6);
        assert_eq!(warned, ["/b/n"]);
    }
}
