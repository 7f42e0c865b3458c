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

triple() {
    rust_target "$(in_the_jar "$1")"
}

# cross_tools PLATFORMS PACKAGE...: installs the compilers and linkers for these platforms, and further packages of Debian.
cross_tools() {
    local platforms=$1 packages=("${@:2}") platform target
    for platform in $platforms; do
        target=$(triple "$platform")
        [ -d "$(rustc --print sysroot)/lib/rustlib/$target" ] || rustup target add "$target" ||
            die "there is no standard library of Rust for $target (rustup target add $target)"
        case $platform in
            windows) have x86_64-w64-mingw32-gcc || packages+=(gcc-mingw-w64-x86-64) ;;
            arm64) have aarch64-linux-gnu-strip || packages+=(binutils-aarch64-linux-gnu) ;;
        esac
    done
    if [ ${#packages[@]} -gt 0 ]; then
        if ! can_install; then
            echo "install ${packages[*]}"
            exit 77
        fi
        as_root apt-get update -qq
        DEBIAN_FRONTEND=noninteractive as_root apt-get install -y -qq --no-install-recommends "${packages[@]}" >/dev/null
    fi
    tools/peers --cross
}

# Between flags for the compiler in CARGO_ENCODED_RUSTFLAGS: paths may have blanks.
BETWEEN_FLAGS=$'\x1f'

# cargo for a platform, in a folder of its own. Linux programs are linked by zig, against the C library of any age.
cross_cargo() {
    local platform=$1 command=$2 target
    shift 2
    target=$(triple "$platform")
    export CARGO_INCREMENTAL=0 CARGO_TARGET_DIR=$ROOT/target/platforms/$platform
    if [ "$platform" = windows ]; then
        # The C runtime goes into the files: some Windows have none.
        local flags=${CARGO_ENCODED_RUSTFLAGS:+$CARGO_ENCODED_RUSTFLAGS$BETWEEN_FLAGS}
        CARGO_ENCODED_RUSTFLAGS="${flags}-C${BETWEEN_FLAGS}target-feature=+crt-static" cargo "$command" --target "$target" "$@"
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
    echo "target/platforms/$1/$(triple "$1")/release"
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
            windows)
                needed=$(x86_64-w64-mingw32-objdump -p "$file" | sed -n 's/.*DLL Name: //p' | tr '[:upper:]' '[:lower:]' |
                    grep -vxE '(kernel32|ntdll|ws2_32|advapi32|bcrypt|bcryptprimitives|userenv|winmm|crypt32|secur32|ole32|shell32|user32|msvcrt|api-ms-win-[a-z0-9-]*)\.dll' || true)
                ;;
            linux | arm64)
                needed=$(objdump_any "$file" | grep -oE 'GLIBC_[0-9.]+' | sort -uV |
                    awk -F_ -v most="$GLIBC" '{ split($2, v, "."); split(most, m, "."); if (v[1] * 1000 + v[2] > m[1] * 1000 + m[2]) print }')
                ;;
            musl) needed=$(objdump_any "$file" | grep NEEDED || true) ;;
        esac
        echo "$file: $(wc -c <"$file") bytes"
        [ -z "$needed" ] || die "$file needs $needed, which not every system has"
    done
}

objdump_any() {
    readelf --dynamic --version-info --wide "$1" 2>/dev/null
}
