# shellcheck shell=bash
# Builds for other platforms on Linux x86-64: linux (with an older C library), windows, arm64 and musl. Sourced after common.sh.

# The oldest C library of Linux on which all of it must run: that of Debian 10, RHEL 8 and Ubuntu 20.04.
GLIBC=2.28

# The name of a platform in the jar.
in_the_jar() {
    case $1 in
        linux) echo linux-x86_64 ;;
        windows) echo windows-x86_64 ;;
        arm64) echo linux-aarch64 ;;
        musl) echo linux-x86_64-musl ;;
        *) die "there is no platform $1: linux, windows, arm64 or musl" ;;
    esac
}

# The platform whose name in the jar is given.
from_the_jar() {
    local platform
    for platform in linux windows arm64 musl; do
        [ "$(in_the_jar "$platform")" != "$1" ] || echo "$platform"
    done
}

triple() {
    rust_target "$(in_the_jar "$1")"
}

# cross_tools PLATFORMS PACKAGE...: installs the compilers and linkers for these platforms, and further packages of Debian.
cross_tools() {
    local platforms=$1 packages=("${@:2}") platform target
    for platform in $platforms; do
        target=$(triple "$platform")
        [ -d "$(rustc --print sysroot)/lib/rustlib/$target" ] || rustup target add "$target" ||
            skip "there is no standard library of Rust for $target (rustup target add $target)"
        case $platform in
            windows) have x86_64-w64-mingw32-gcc || packages+=(gcc-mingw-w64-x86-64) ;;
            arm64) have aarch64-linux-gnu-strip || packages+=(binutils-aarch64-linux-gnu) ;;
        esac
    done
    [ ${#packages[@]} -eq 0 ] || { can_install && apt_install "${packages[@]}"; } || skip "install ${packages[*]}"
    tools/peers --cross
}

# Set where a release is built: paths of this computer, which stand in messages of panics, do not get into its files.
WITHOUT_PATHS=

# The flags of the compiler for a platform, as CARGO_ENCODED_RUSTFLAGS has them, since paths may have blanks.
compiler_flags() {
    local flags=() folder
    # The C runtime goes into the files: some Windows have none.
    [ "$1" != windows ] || flags+=(-C target-feature=+crt-static)
    if [ -n "$WITHOUT_PATHS" ]; then
        flags+=("--remap-path-prefix=$ROOT=tickbus")
        for folder in "${CARGO_HOME:-$HOME/.cargo}"/registry/src/*; do
            flags+=("--remap-path-prefix=$folder=crates")
        done
    fi
    local IFS=$'\x1f'
    echo "${flags[*]}"
}

# What cargo makes for other platforms: in one folder, since macros and build scripts, which run here, are the same for all.
CROSS_TARGET=target/platforms/cargo
# The folder of the profile there.
CROSS_PROFILE=release

# cargo for a platform. Linux programs are linked by zig, against the C library of any age.
cross_cargo() {
    local platform=$1 command=$2 target flags
    shift 2
    target=$(triple "$platform")
    flags=$(compiler_flags "$platform")
    [ -z "$flags" ] || export CARGO_ENCODED_RUSTFLAGS=$flags
    export CARGO_INCREMENTAL=0 CARGO_TARGET_DIR=$ROOT/$CROSS_TARGET
    if [ "$platform" = windows ]; then
        cargo "$command" --target "$target" "$@"
        return
    fi
    [[ $target != *-gnu ]] || target=$target.$GLIBC
    PATH=$ROOT/target/peers/cross/bin:$PATH
    case $command in
        build) cargo-zigbuild zigbuild --target "$target" "$@" ;;
        test) cargo-zigbuild test --target "$target" "$@" ;;
    esac
}

# The folder with what cargo has made for a platform.
made() {
    echo "$CROSS_TARGET/$(triple "$1")/$CROSS_PROFILE"
}

# stripped PLATFORM FILE COPY: a copy of a made file without debug tables.
stripped() {
    local strip
    case $1 in
        windows) strip=x86_64-w64-mingw32-strip ;;
        arm64) strip=aarch64-linux-gnu-strip ;;
        *) strip='strip' ;;
    esac
    "$strip" -o "$3" "$(made "$1")/$2"
}

# imports PLATFORM FILE...: fails if a file needs a library that some systems do not have.
imports() {
    local platform=$1 file needed
    for file in "${@:2}"; do
        case $platform in
            windows) needed=$(foreign_dlls "$file") ;;
            linux | arm64) needed=$(newer_glibc "$file") ;;
            musl) needed=$(readelf --dynamic --wide "$file" | grep NEEDED || true) ;;
        esac
        echo "$file: $(wc -c <"$file") bytes"
        [ -z "$needed" ] || die "$file needs $needed, which not every system has"
    done
}

# The libraries that a file needs and that not every Windows has.
foreign_dlls() {
    x86_64-w64-mingw32-objdump -p "$1" | sed -n 's/.*DLL Name: //p' | tr '[:upper:]' '[:lower:]' |
        grep -vxE '(kernel32|ntdll|ws2_32|iphlpapi|advapi32|bcrypt|bcryptprimitives|userenv|winmm|crypt32|ncrypt|secur32|ole32|shell32|user32|msvcrt|api-ms-win-[a-z0-9-]*)\.dll' || true
}

# The versions of the C library that a file needs and that are newer than the oldest one.
newer_glibc() {
    readelf --dynamic --version-info --wide "$1" 2>/dev/null | grep -oE 'GLIBC_[0-9.]+' | sort -uV |
        awk -F '[_.]' -v most="$GLIBC" '{ split(most, m, "."); if ($2 * 1000 + $3 > m[1] * 1000 + m[2]) print }'
}
