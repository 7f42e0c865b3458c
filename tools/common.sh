# shellcheck shell=bash
# Shared by the scripts in this folder, which source it.

set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$ROOT"

# A failure of this project's own checks: what happened, and what to do.
die() {
    printf '%s: %s\n' "$(basename "$0")" "$*" >&2
    exit 1
}

have() {
    command -v "$1" >/dev/null 2>&1
}

# True if system packages can be installed: on Debian or Ubuntu, as root or with a sudo that asks for no password.
can_install() {
    have apt-get && { [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; }
}

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

# apt_install PACKAGE...
apt_install() {
    as_root apt-get update -qq && apt_install_listed "$@"
}

# The same, with the lists of packages that are there.
apt_install_listed() {
    DEBIAN_FRONTEND=noninteractive as_root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# The exit code of a stage or a part that was skipped.
SKIPPED=77

# Ends a stage that cannot be run on this machine, with the reason.
skip() {
    echo "$*"
    exit "$SKIPPED"
}

# needs COMMAND:PACKAGE...: installs the packages of commands that are missing, or skips the stage.
needs() {
    local entry packages=()
    for entry in "$@"; do
        have "${entry%%:*}" || packages+=("${entry##*:}")
    done
    [ ${#packages[@]} -eq 0 ] || { can_install && apt_install "${packages[@]}"; } || skip "install ${packages[*]}"
}

# at_least 1.88 1.95.0: true if the second version is at least the first.
at_least() {
    [ "$(printf '%s\n%s\n' "$1" "$2" | sort -V | head -n 1)" = "$1" ]
}

# The zip's features beyond a plain build. Not all, since the zip has a limit (tools/dist-check).
# shellcheck disable=SC2034 # for the scripts that source this
PRODUCT_FEATURES=opcua,page,mqtt,modbus-tls

# Has the linker keep one copy of identical functions, of which OPC UA has thousands, where it can (Rust's own does on
# Linux): library and command become smaller by a twentieth. Used in every build of the product, so that none is rebuilt.
link_small() {
    local option=-Wl,--icf=all probe
    probe=$(mktemp -d)
    if echo 'fn main() {}' | rustc - -C link-arg="$option" -o "$probe/probe" 2>/dev/null; then
        export TICKBUS_LINK_ARG=$option
    fi
    rm -rf "$probe"
}

# The project's version, from Cargo.toml.
version() {
    sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1
}

# Operating system and processor as the Java library names them, such as linux-x86_64.
platform() {
    local system processor
    case "$(uname -s)" in
        Linux) system=linux ;;
        Darwin) system=macos ;;
        MINGW* | MSYS* | CYGWIN*) system=windows ;;
        *) system=$(uname -s | tr '[:upper:]' '[:lower:]') ;;
    esac
    case "$(uname -m)" in
        x86_64 | amd64) processor=x86_64 ;;
        aarch64 | arm64) processor=aarch64 ;;
        *) processor=$(uname -m) ;;
    esac
    printf '%s-%s\n' "$system" "$processor"
}

# The target of Rust for a platform, as the Java library names it.
rust_target() {
    case $1 in
        linux-x86_64-musl) echo x86_64-unknown-linux-musl ;;
        linux-*) echo "${1#linux-}-unknown-linux-gnu" ;;
        macos-*) echo "${1#macos-}-apple-darwin" ;;
        windows-*) echo "${1#windows-}-pc-windows-gnu" ;;
        *) die "Rust has no target for $1" ;;
    esac
}

# The native library's file name on this system.
native_library() {
    case "$(platform)" in
        windows-*) echo tickbus.dll ;;
        macos-*) echo libtickbus.dylib ;;
        *) echo libtickbus.so ;;
    esac
}

# The tickbus command's file name on this system.
tickbus_command() {
    case "$(platform)" in
        windows-*) echo tickbus.exe ;;
        *) echo tickbus ;;
    esac
}

# The folder of tools/build for the tickbus command without its debug tables, and for the tables.
STRIPPED=target/stripped
DEBUG_TABLES=target/debug-tables

# without_debug_tables FILE COPY: copies FILE without debug tables, which take up more than half of it. If the tools are
# installed, the tables go to a separate file, named after the copy with .debug, where debuggers find them.
without_debug_tables() {
    mkdir -p "$(dirname "$2")" "$DEBUG_TABLES"
    local tables
    tables=$DEBUG_TABLES/$(basename "$2").debug
    if have objcopy; then
        objcopy --only-keep-debug "$1" "$tables"
        objcopy --strip-all --add-gnu-debuglink="$tables" "$1" "$2"
    elif have strip; then
        strip -x -o "$2" "$1"
    else
        cp "$1" "$2"
    fi
}

# median_ms COMMAND...: the milliseconds that a command takes, as the median of nine.
median_ms() {
    local begun
    for _ in $(seq 9); do
        begun=$(date +%s%N)
        "$@" >/dev/null
        echo $((($(date +%s%N) - begun) / 1000000))
    done | sort -n | sed -n 5p
}

# The time of everything in an archive: that of the commit.
archive_time() {
    echo "${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}"
}

# reproducible_zip FILE FOLDER: packs a folder with its name. Order, times and permissions of the entries do not depend on the
# computer; those of the folder itself change for that.
reproducible_zip() {
    local file folder=$2
    file=$(realpath -m "$1")
    rm -f "$file"
    find "$folder" -exec touch -h -d "@$(archive_time)" {} +
    chmod -R u=rwX,go=rX "$folder"
    (cd "$(dirname "$folder")" && find "$(basename "$folder")" ! -type d | LC_ALL=C sort | TZ=UTC zip -q -X -9 -@ "$file")
}

# The files of a release, relative to target/dist: those in it, and the jars and POMs of the Maven repository, which has its own
# checksums beside them. Folders are what zips were packed from.
release_files() {
    (
        cd target/dist
        find . -maxdepth 1 -type f ! -name SHA256SUMS ! -name '*.asc' ! -name tickbus-maven.zip -printf '%P\n'
        [ ! -d crates ] || find crates -type f
        [ ! -d maven ] || find maven -type f \( -name '*.jar' -o -name '*.pom' \)
    ) | LC_ALL=C sort
}

# One pip for all environments under target/: installing pip into each takes longer than installing their packages.
PIP=target/peers/pip

has_pip() {
    [ -x "$PIP/bin/pip" ] && return
    rm -rf "$PIP"
    # Since version 22.3, pip can install into other environments.
    python3 -m venv "$PIP" && "$PIP/bin/pip" install --quiet --disable-pip-version-check 'pip>=22.3'
}

# pip_into FOLDER COMMAND...: for the environment in FOLDER.
pip_into() {
    "$PIP/bin/pip" --quiet --disable-pip-version-check --python "$1/bin/python" "${@:2}"
}

# True if there is an iec2c: named by IEC2C, on the PATH, or in shared/peers beside the checkout. Sets IEC2C to it.
has_iec2c() {
    if [ -z "${IEC2C:-}" ] && ! have iec2c && [ -x "$ROOT/../shared/peers/iec2c/iec2c" ]; then
        IEC2C=$ROOT/../shared/peers/iec2c/iec2c
    fi
    export IEC2C=${IEC2C:-iec2c}
    have "$IEC2C"
}

# For programs that end before a thorough compiler would pay; and without the warning on stdout of a JVM that finds another
# one's file of measurements.
SHORT_JVM="-XX:TieredStopAtLevel=1 -XX:+UseSerialGC -XX:-UsePerfData"

# Runs Maven on the Java reactor, quietly and without colours.
maven() {
    MAVEN_OPTS="${MAVEN_OPTS:-$SHORT_JVM}" \
    mvn -q -B -ntp -f java "$@" 2>&1 | sed $'s/\033\\[[0-9;]*m//g'
}

# assemble FOLDER [COMMAND]: lays out the distribution in a folder: DeviceDriver/ (the drop-in driver, a driver.cfg, the tickbus
# command) and simulator/ (the simulator, the machines with their control tables and demos, and in peeler/ the driver.cfg of the
# peeling line). Needs the output of tools/build.
assemble() {
    local folder=$1 command=${2:-$STRIPPED/$(tickbus_command)} release
    release=$(version)
    rm -rf "$folder/DeviceDriver" "$folder/simulator"
    mkdir -p "$folder/DeviceDriver" "$folder/simulator/peeler"
    cp plc/peeler/*.cfg "$folder/simulator/peeler/"
    # The command is needed for plug-ins in helper processes.
    cp driver.cfg "java/DeviceDrivers/target/device-drivers-$release.jar" "$command" "$folder/DeviceDriver/"
    cp java/machines/*.table "java/machines/target/tickbus-machines-$release.jar" "java/simulator/target/simulator-$release.jar" \
        "java/control-interface/target/control-interface-$release.jar" "$folder/simulator/"
}
