#!/usr/bin/env python3
"""Makes the JSON schemas of src/guide/schemas from the types that the program reads and writes.

    scripts/schemas.py            writes the schemas
    scripts/schemas.py --check    compares them with what is there, byte for byte; exits with 1 and
                                  names the first file that differs

A schema follows the Rust type of its file: fields, types, words of enums, and the sentences of
their documentation. `#[serde(default)]` makes a field optional; `deny_unknown_fields` closes an
object. Files that the program writes stay open, since they grow by adding fields.
`tests/schemas.rs` checks files of a real run against the schemas. Standard library only.
"""

import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "src/guide/schemas"
DRAFT = "https://json-schema.org/draft/2020-12/schema"
INTEGERS = {"u8": (0, 255), "u16": (0, 65535), "u32": (0, 2**32 - 1), "u64": (0, None),
            "usize": (0, None), "i16": (-32768, 32767), "i32": (-2**31, 2**31 - 1),
            "i64": (None, None)}


def sources():
    """The text of every Rust file of stages and src, by path."""
    paths = [*ROOT.glob("stages/*/src/**/*.rs"), *ROOT.glob("src/**/*.rs")]
    return {str(p.relative_to(ROOT)): p.read_text(encoding="utf-8") for p in sorted(paths)}


TEXTS = sources()


def sentence(lines):
    """Documentation as one text, without links of rustdoc."""
    text = " ".join(line.strip() for line in lines).strip()
    text = re.sub(r"\[`([^`\]]+)`\]", lambda m: m[1].rsplit("::", 1)[-1], text)
    return text.replace("`", "'")


class Item:
    """A field or a variant: documentation, attributes, name, and type or fields."""

    def __init__(self, docs, attributes, name, kind):
        self.docs, self.serde, self.name, self.kind = sentence(docs), attributes, name, kind

    def has(self, word):
        return re.search(rf"\b{word}\b", self.serde) is not None

    def renamed(self):
        found = re.search(r'rename = "([^"]+)"', self.serde)
        return found[1] if found else self.name


class Type:
    """A struct or an enum of the sources."""

    def __init__(self, name, path=None):
        head = re.compile(rf"^(?:pub(?:\([a-z]+\))? )?(struct|enum) {name} \{{$", re.M)
        places = [path] if path else list(TEXTS)
        found = [(p, m) for p in places for m in head.finditer(TEXTS[p])]
        if len(found) != 1:
            raise SystemExit(f"error: {len(found)} types are called {name} in {path or 'the sources'}")
        text, at = TEXTS[found[0][0]], found[0][1]
        self.name, self.word = name, at[1]
        body = text[at.end() + 1:text.index("\n}", at.end()) + 1]
        # Documentation and attributes reach up to the blank line before them.
        above = text[:at.start()].rsplit("\n\n", 1)[-1]
        self.docs = sentence(re.findall(r"^/// ?(.*)", above, re.M))
        self.serde = " ".join(re.findall(r"serde\(([^\n]*)\)\]", above))
        self.items = list(self.read(body))

    def read(self, body):
        docs, serde, open_variant = [], "", None
        for line in body.splitlines():
            text = line.strip()
            if text.startswith("///"):
                docs.append(text[3:])
            elif text.startswith("#["):
                serde += " " + " ".join(re.findall(r"serde\((.*)\)\]", text))
            elif open_variant is not None:
                if text.startswith("}"):
                    yield open_variant
                    open_variant = None
                elif ":" in text:
                    name, kind = text.rstrip(",").split(": ", 1)
                    open_variant.kind.append(Item(docs, serde, name, kind))
                docs, serde = ([], "") if not text.startswith("//") else (docs, serde)
            elif self.word == "enum" and text.endswith("{"):
                open_variant = Item(docs, serde, text.rstrip(" {"), [])
                docs, serde = [], ""
            elif text and not text.startswith("//"):
                text = re.sub(r"^pub(\([a-z]+\))? ", "", text).rstrip(",")
                name, kind = (text.split(": ", 1) + [None])[:2]
                yield Item(docs, serde, name, kind)
                docs, serde = [], ""


def snake(name):
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


class Schema:
    """A schema under construction: types that are met become definitions."""

    def __init__(self, is_input):
        self.is_input, self.defs = is_input, {}

    def of(self, kind):
        kind = kind.removeprefix("contract::").removeprefix("super::")
        if kind in INTEGERS:
            low, high = INTEGERS[kind]
            limits = {"minimum": low, "maximum": high}
            return {"type": "integer", **{k: v for k, v in limits.items() if v is not None}}
        if kind in ("f64", "f32"):
            return {"type": "number"}
        if kind == "bool":
            return {"type": "boolean"}
        if kind in ("String", "PathBuf"):
            return {"type": "string"}
        if found := re.fullmatch(r"Option<(.*)>", kind):
            inner = self.of(found[1])
            if self.is_input:
                return inner
            if isinstance(inner.get("type"), str):
                return {**inner, "type": [inner["type"], "null"]}
            return {"anyOf": [inner, {"type": "null"}]}
        if found := re.fullmatch(r"Vec<(.*)>", kind):
            return {"type": "array", "items": self.of(found[1])}
        if found := re.fullmatch(r"\[(.*); (\d+)\]", kind):
            n = int(found[2])
            return {"type": "array", "items": self.of(found[1]), "minItems": n, "maxItems": n}
        if found := re.fullmatch(r"(?:NamedMap|BTreeMap<String,) ?<?(.*?)>", kind):
            return {"type": "object", "additionalProperties": self.of(found[1])}
        if kind not in self.defs:
            self.defs[kind] = None
            self.defs[kind] = self.type(Type(kind))
        return {"$ref": f"#/$defs/{kind}"}

    def type(self, of):
        said = {"description": of.docs} if of.docs else {}
        if of.word == "enum":
            return {**said, **self.enum(of)}
        properties = {}
        required = []
        for item in of.items:
            if item.has("skip"):
                continue
            about = self.of(item.kind)
            properties[item.renamed()] = {"description": item.docs, **about} if item.docs else about
            optional = item.has("default") or re.search(r"\bdefault\b", of.serde)
            optional = optional or self.is_input and item.kind.startswith("Option<")
            if not optional:
                required.append(item.renamed())
        out = {**said, "type": "object", "properties": properties}
        if required:
            out["required"] = required
        if "deny_unknown_fields" in of.serde:
            out["additionalProperties"] = False
        return out

    def enum(self, of):
        lower = "rename_all" in of.serde
        word = lambda item: snake(item.name) if lower and item.renamed() == item.name else item.renamed()
        tag = re.search(r'tag = "(\w+)"', of.serde)
        if not tag:
            words = [w for i in of.items for w in [word(i), *re.findall(r'alias = "([^"]+)"', i.serde)]]
            return {"type": "string", "enum": words}
        kinds = []
        for item in of.items:
            fields = {f.renamed(): {"description": f.docs, **self.of(f.kind)} for f in item.kind or []}
            kinds.append({"description": item.docs, "type": "object",
                          "properties": {tag[1]: {"const": word(item)}, **fields},
                          "required": [tag[1], *fields]})
        return {"oneOf": kinds}

    def finish(self, name, title, root):
        out = {"$schema": DRAFT, "$id": f"stillpoint:{name}", "title": title, **root}
        if self.defs:
            out["$defs"] = dict(sorted(self.defs.items()))
        return out


def of_type(name, kind, title, is_input):
    schema = Schema(is_input)
    return schema.finish(name, title, schema.type(Type(kind)))


def result():
    schema = of_type("result", "ResultFile", "result.json of a run of Stillpoint", False)
    schema["properties"]["schema"] = {"const": "stillpoint.result/1"}
    return schema


def shards():
    schema = of_type("shards", "ShardList", "The list of the shards of a job (shards --json)", False)
    schema["properties"]["schema"] = {"const": "stillpoint.shards/1"}
    return schema


def manifest():
    schema = of_type("manifest", "Manifest", "manifest.json: the list of a result's files", False)
    schema["properties"]["schema"] = {"const": "stillpoint.manifest/2"}
    digest = "Digest of all bytes of the file before this field."
    schema["properties"]["digest"] = {"description": digest, "type": "string"}
    return schema


def changes():
    """changes.json is put together in src/rescan/report.rs."""
    schema = Schema(False)
    corners = {"type": "array", "items": {"type": "array", "items": {"type": "number"}, "minItems": 3,
                                          "maxItems": 3}, "minItems": 2, "maxItems": 2}
    region = {"type": "object", "required": ["bounds", "volume_m3", "n_points"], "properties": {
        "bounds": {"description": "Lowest and highest corner, world, metres.", **corners},
        "volume_m3": {"description": "Volume of its voxels, m³.", "type": "number"},
        "n_points": {"description": "Number of its points.", "type": "integer", "minimum": 0}}}
    listed = lambda kind, text: {"description": text, "type": "array", "items": schema.of(kind)}
    properties = {
        "schema": {"const": "stillpoint.changes/1"},
        "base": {"description": "Folder of the earlier result.", "type": "string"},
        "cell": {"description": "Bounds of the cell, world, metres: lowest and highest corner.",
                 **corners},
        "frame": {"description": "The frame of the new scans, if it is not the plant's.",
                  **schema.of("Option<CarriedEntry>")},
        "scans": listed("RegistrationEntry", "How far each new scan was off."),
        "robots": listed("RobotChange", "Robots of the cell, before and now."),
        "things": listed("ThingEntry", "Bodies that appeared, went or moved."),
        "fixed_not_compared": {"description": "Fixed things that no new beam reached.",
                               "type": "array", "items": region},
        "not_compared": listed("String", "Ids of robots that the new scans hardly see."),
    }
    root = {"description": "What a rescan found to be different.", "type": "object",
            "properties": properties, "required": list(properties)}
    return schema.finish("changes", "changes.json of a rescan", root)


def config():
    """Settings by stage, as src/job/settings.rs lists them."""
    text = TEXTS["src/job/settings.rs"].split("\nsettings! {", 1)[1].split("\n}\n", 1)[0]
    rooms = {}
    for room, crate, kind, names in re.findall(r"(\w+): (\w+)::(\w+) \{(.*?)\}", text, re.S):
        folder = f"stages/{crate}/src/"
        path = next(p for p, t in TEXTS.items()
                    if p.startswith(folder) and f"\npub struct {kind} {{" in t)
        items = {item.name: item for item in Type(kind, path).items}
        fields = {}
        for name in names.replace("\n", " ").split(","):
            if name := name.strip():
                schema = Schema(True).of(items[name].kind)
                if items[name].kind.startswith("Option<"):
                    schema = {"anyOf": [schema, {"const": "none"}]}
                fields[name] = {"description": items[name].docs, **schema}
        rooms[room] = {"type": "object", "properties": fields, "additionalProperties": False}
    method = {"description": "How postures are found.", "type": "string", "enum": ["beam", "paper"]}
    rooms["fit"]["properties"] = {"method": method, **rooms["fit"]["properties"]}
    properties = {
        "memory": {"description": "Upper bound of resident memory: bytes, or a size such as 4GiB.",
                   "type": ["string", "integer"]},
        "threads": {"description": "Number of worker threads.", "type": "integer", "minimum": 1,
                    "maximum": 1024},
        "scanners": {"description": "File of scanner poses, relative to this file.",
                     "type": "string"},
        **rooms}
    return {"$schema": DRAFT, "$id": "stillpoint:config", "title": "A --config file of Stillpoint",
            "type": "object", "properties": properties, "additionalProperties": False}


SCHEMAS = {
    "result": result,
    "changes": changes,
    "manifest": manifest,
    "scanners": lambda: of_type("scanners", "ScannersFile", "A --scanners file (TOML or JSON)", True),
    "config": config,
    "review": lambda: of_type("review", "Review", "A --review file (TOML)", True),
    "readings": lambda: of_type("readings", "PostureReadings",
                                "A --readings file of robots calibrate (TOML)", True),
    "robot": lambda: of_type("robot", "Sheet", "robot.toml of a model in a robot library", True),
    "scene": lambda: of_type("scene", "Scene", "A scene file of simulate (TOML)", True),
    "shards": shards,
}


def main():
    is_check = sys.argv[1:] == ["--check"]
    if sys.argv[1:] and not is_check:
        raise SystemExit(__doc__)
    OUT.mkdir(parents=True, exist_ok=True)
    for name, make in SCHEMAS.items():
        path = OUT / f"{name}.schema.json"
        text = json.dumps(make(), indent=1, ensure_ascii=False) + "\n"
        if not is_check:
            path.write_text(text, encoding="utf-8")
        elif not path.exists() or path.read_text(encoding="utf-8") != text:
            raise SystemExit(f"error: {path.relative_to(ROOT)} differs from the types: "
                             "scripts/schemas.py makes it anew")
    print(f"{len(SCHEMAS)} schemas {'agree with the types' if is_check else 'written'}")


if __name__ == "__main__":
    main()
