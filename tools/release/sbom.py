"""Writes and checks the list of components of a release, by CycloneDX. tools/release/sbom calls it.

Two sources: cargo's tree of the crates, and the artefacts themselves, which are opened to see what is inside.
"""

import datetime
import hashlib
import io
import json
import os
import pathlib
import re
import sys
import tomllib
import uuid
import zipfile

from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom, BomMetaData
from cyclonedx.model.component import Component, ComponentScope, ComponentType
from cyclonedx.model.license import LicenseExpression
from cyclonedx.output import make_outputter
from cyclonedx.schema import OutputFormat, SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from license_expression import get_spdx_licensing
from packageurl import PackageURL

SCHEMA = SchemaVersion.V1_6
OURS = "MIT OR Apache-2.0"
# Every crate must be usable under one of these.
LICENCES = {
    "MIT", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "ISC", "MPL-2.0", "Unicode-3.0", "Unicode-DFS-2016", "Zlib",
    "CC0-1.0", "0BSD", "Unlicense",
}
# How the names of files and folders spell a platform.
SPELLINGS = {
    "linux-x86_64": r"linux-x86_64|linux(_\d+)*_x86_64|linux64|x86_64-linux",
    "linux-aarch64": r"linux-aarch64|linux(_\d+)*_aarch64|aarch64-linux",
    "windows-x86_64": r"windows-x86_64|win_amd64|win64|x86_64-windows",
    "macos-x86_64": r"macos-x86_64|macosx(_\d+)*_x86_64|darwin64|x86_64-darwin",
    "macos-aarch64": r"macos-aarch64|macosx(_\d+)*_arm64|aarch64-darwin",
}
# How programs and libraries begin: ELF, Windows, macOS.
BINARY = (b"\x7fELF", b"MZ", b"\xcf\xfa\xed\xfe")


def fail(message):
    sys.exit(f"sbom: {message}")


def platform_in(path):
    """The platform that a path names; None if it names none."""
    return next((name for name, spelling in SPELLINGS.items() if re.search(spelling, path)), None)


def spdx(licence):
    """A crate's licence as an expression; old manifests have a slash for "or"."""
    return re.sub(r"\s*/\s*", " OR ", licence)


def reachable(edges, start, without=frozenset()):
    """A component with all that it contains, directly or not."""
    seen, todo = set(), [start]
    while todo:
        ref = todo.pop()
        if ref not in seen and ref not in without:
            seen.add(ref)
            todo += edges[ref]
    return seen


class Release:
    """The components of one platform's artefacts."""

    def __init__(self, version, platform):
        self.version = version
        self.platform = platform
        self.components = {}
        self.edges = {}
        self.packages = {
            file.parent.relative_to(root).as_posix()
            for root in pathlib.Path("java").glob("*/src/main/java")
            for file in root.rglob("*.java")
        }

    def add(self, ref, **fields):
        """A component, once."""
        if ref not in self.components:
            self.components[ref] = Component(bom_ref=ref, **fields)
            self.edges[ref] = set()
        return ref

    def tree(self, text, checksums):
        """Crates, from the output of cargo tree. Returns the root."""
        path, macros = [], set()
        for line in text.splitlines():
            depth, package, licence, _ = line.split("|")
            name, version = package.split()[:2]
            version = version.removeprefix("v")
            purl = PackageURL("cargo", None, name, version)
            checksum = checksums.get((name, version))
            ref = self.add(
                purl.to_string(),
                name=name,
                version=version,
                purl=purl,
                scope=ComponentScope.EXCLUDED,
                licenses=[LicenseExpression(spdx(licence))] if licence else [],
                hashes=[HashType(alg=HashAlgorithm.SHA_256, content=checksum)] if checksum else [],
            )
            if "(proc-macro)" in package:
                macros.add(ref)
            path[int(depth):] = [ref]
            if len(path) > 1:
                self.edges[path[-2]].add(ref)
        # A macro, and what it needs, runs in the compiler, and is not linked.
        for ref in reachable(self.edges, path[0], macros):
            self.components[ref].scope = ComponentScope.REQUIRED
        return path[0]

    def file(self, name, content, **fields):
        """A file, named after its bytes, of which there may be several versions: in zip and repository, for example."""
        digest = hashlib.sha256(content).hexdigest()
        hashes = [HashType(alg=HashAlgorithm.SHA_256, content=digest)]
        ref = f"{name}#{digest[:16]}"
        return self.add(ref, name=name, type=ComponentType.FILE, version=self.version, hashes=hashes, **fields)

    def binary(self, path, content, roots):
        """A program or library inside an artefact, and the crate that it is made of."""
        name = path.rsplit("/", 1)[-1]
        if name.startswith("_native"):
            root = roots["tickbus-python"]
        elif re.match(r"(lib)?tickbus\b", name) or re.search(r"(^|/)binaries/[^/]+/[^/]+$", path):
            root = roots["tickbus"]
        else:
            fail(f"{path} is a program or a library of unknown origin")
        ref = self.file(name, content)
        self.edges[ref].add(root)
        return ref

    def contents(self, owner, archive, roots):
        """What is inside a zip, a jar, a wheel or an FMU."""
        is_jar = owner.split("#")[0].endswith(".jar")
        for path in sorted(archive.namelist()):
            if path.endswith("/"):
                continue
            with archive.open(path) as entry:
                begin = entry.read(4)
            if is_jar and path.endswith(".class"):
                package = re.sub(r"^META-INF/versions/\d+/", "", path).rpartition("/")[0]
                if package not in self.packages | {""}:
                    fail(f"{owner} has {path}, which is not in the sources")
            elif re.fullmatch(r"META-INF/maven/[^/]+/[^/]+/pom\.properties", path):
                self.edges[owner].add(self.module(archive.read(path).decode()))
            elif platform_in(path) not in (None, self.platform):
                continue
            elif begin.startswith(BINARY):
                self.edges[owner].add(self.binary(path, archive.read(path), roots))
            elif path.endswith(".jar"):
                self.edges[owner].add(self.archive(path, archive.read(path), roots))

    def module(self, properties):
        """A Maven module, by the file that Maven puts into its jar."""
        fields = dict(line.split("=", 1) for line in properties.split() if "=" in line)
        group, name, version = fields["groupId"], fields["artifactId"], fields["version"]
        purl = PackageURL("maven", group, name, version)
        return self.add(
            purl.to_string(), group=group, name=name, version=version, purl=purl, licenses=[LicenseExpression(OURS)]
        )

    def archive(self, path, content, roots):
        """An artefact, or one inside another."""
        name = path.rsplit("/", 1)[-1]
        fields = {"licenses": [LicenseExpression(OURS)]}
        if name.endswith(".whl"):
            fields["purl"] = PackageURL("pypi", None, "tickbus", self.version, {"file_name": name})
        ref = self.file(name, content, **fields)
        with zipfile.ZipFile(io.BytesIO(content)) as opened:
            self.contents(ref, opened, roots)
        return ref

    def bom(self, commit, time, artefacts):
        """The document: the same for the same commit and artefacts."""
        product = Component(
            name="tickbus",
            version=self.version,
            type=ComponentType.APPLICATION,
            bom_ref=f"tickbus {self.version} {self.platform}",
            purl=PackageURL("generic", None, "tickbus", self.version, {"platform": self.platform}),
            licenses=[LicenseExpression(OURS)],
        )
        serial = uuid.uuid5(uuid.NAMESPACE_URL, f"{product.purl}#{commit}")
        moment = datetime.datetime.fromtimestamp(time, datetime.timezone.utc)
        bom = Bom(
            serial_number=serial,
            metadata=BomMetaData(component=product, timestamp=moment),
            components=self.components.values(),
        )
        for ref, targets in self.edges.items():
            bom.register_dependency(self.components[ref], [self.components[target] for target in sorted(targets)])
        bom.register_dependency(product, [self.components[ref] for ref in artefacts])
        return bom


def write(out, platform, version, commit, compiler, library, python, *paths):
    """The list of one platform. library and python are files with the output of cargo tree."""
    release = Release(version, platform)
    lock = tomllib.loads(pathlib.Path("Cargo.lock").read_text())
    checksums = {(crate["name"], crate["version"]): crate.get("checksum") for crate in lock["package"]}
    roots = {
        "tickbus": release.tree(pathlib.Path(library).read_text(), checksums),
        "tickbus-python": release.tree(pathlib.Path(python).read_text(), checksums),
    }
    standard = release.add(
        PackageURL("generic", None, "rust-std", compiler).to_string(),
        name="rust-std",
        version=compiler,
        purl=PackageURL("generic", None, "rust-std", compiler),
        description="The standard library of Rust",
        licenses=[LicenseExpression(OURS)],
    )
    for root in roots.values():
        release.edges[root].add(standard)
    artefacts = [
        release.archive(path, pathlib.Path(path).read_bytes(), roots) for path in paths if platform_in(path) in (None, platform)
    ]
    if not artefacts:
        fail(f"target/dist has no artefact for {platform}")
    bom = release.bom(commit, int(os.environ["SOURCE_DATE_EPOCH"]), artefacts)
    pathlib.Path(out).write_text(make_outputter(bom, OutputFormat.JSON, SCHEMA).output_as_string(indent=1) + "\n")
    print(f"sbom: ok file={out} artefacts={len(artefacts)} components={len(release.components)}")


def third_party(archive):
    """The crates in an artefact's THIRD-PARTY.txt, as purls; None without one."""
    texts = [archive.read(path).decode() for path in archive.namelist() if path.endswith("THIRD-PARTY.txt")]
    if not texts:
        return None
    crates = re.findall(r"^===== (\S+) (\S+): ", texts[0], re.MULTILINE)
    return {PackageURL("cargo", None, name, version).to_string() for name, version in crates}


def crates_below(edges, start):
    """The crates of others that a component contains."""
    return {ref for ref in reachable(edges, start) if re.match(r"pkg:cargo/(?!tickbus[-@])", ref)}


def permitted(licence):
    """True if one of the alternatives needs only licences of the list."""
    if hasattr(licence, "args") and licence.args:
        return (all if licence.operator.strip() == "AND" else any)(permitted(part) for part in licence.args)
    # An exception, such as LLVM's, only permits more.
    return getattr(licence, "license_symbol", licence).key in LICENCES


def valid(out):
    """A list that follows the schema."""
    text = pathlib.Path(out).read_text()
    error = JsonStrictValidator(SCHEMA).validate_str(text)
    if error:
        fail(f"{out} does not follow CycloneDX {SCHEMA.to_version()}: {error.data.json_path}: {error.data.message}")
    return json.loads(text)


def compare(path, lists):
    """True if the artefact has a THIRD-PARTY.txt. Its crates must be those that the lists of its platforms have for it."""
    content = pathlib.Path(path).read_bytes()
    ref = f"{pathlib.Path(path).name}#{hashlib.sha256(content).hexdigest()[:16]}"
    listed = set()
    for out, document in lists.items():
        if platform_in(path) in (None, platform_in(out)):
            edges = {entry["ref"]: entry.get("dependsOn", []) for entry in document["dependencies"]}
            if ref not in edges:
                fail(f"{out} does not have {path} as it is now: write it again")
            listed |= crates_below(edges, ref)
    with zipfile.ZipFile(path) as opened:
        crates = third_party(opened)
    if crates is None:
        return False
    if crates != listed:
        fail(f"the THIRD-PARTY.txt of {path} and the lists differ: {sorted(crates ^ listed)}")
    return True


def refused(document):
    """The crates whose licence is not permitted."""
    for component in document["components"]:
        if component.get("purl", "").startswith("pkg:cargo/"):
            expression = "".join(entry.get("expression", "") for entry in component.get("licenses", []))
            if not expression or not permitted(get_spdx_licensing().parse(expression, validate=True)):
                yield f"{component['name']} {component['version']}: {expression or 'no licence'}"


def check(outs, *paths):
    """Validates the lists, and compares them with what the artefacts contain."""
    lists = {out: valid(out) for out in outs.split()}
    outside = sorted({line for document in lists.values() for line in refused(document)})
    if outside:
        fail("licences outside the list:\n  " + "\n  ".join(outside))
    compared = sum(compare(path, lists) for path in paths)
    if not compared:
        fail("no artefact has a THIRD-PARTY.txt, so that nothing was compared")
    print(f"sbom: check ok lists={len(lists)} artefacts={len(paths)} compared={compared}")


if __name__ == "__main__":
    {"write": write, "check": check}[sys.argv[1]](*sys.argv[2:])
