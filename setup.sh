#!/usr/bin/env bash
# Installs what this machine lacks to build and run Parhelion; what is there already is not touched.
#
#   ./setup.sh       a linker, shaderc, the Vulkan loader, a Vulkan driver
#   ./setup.sh ci    also what the whole test suite asks for: a driver with ray query, validation layers,
#                    the tools that check its files, and a browser for its pages
set -euo pipefail

mode=${1:-build}
case $mode in
    build | ci) ;;
    *)
        echo "usage: ./setup.sh [ci]" >&2
        exit 2
        ;;
esac

say() { echo "setup: $*"; }
die() {
    echo "setup: $*" >&2
    exit 1
}

. /etc/os-release 2>/dev/null || ID=unknown
debian=false
case " $ID ${ID_LIKE:-} " in
    *" debian "* | *" ubuntu "*) command -v apt-get >/dev/null && debian=true ;;
esac

# --- What is here ---------------------------------------------------------------------------------

# Links a C program against the C++ library, as the build does.
links() {
    command -v cc >/dev/null || return 1
    local folder status=0
    folder=$(mktemp -d)
    echo 'int main(void) { return 0; }' >"$folder/main.c"
    cc "$folder/main.c" -o "$folder/main" -lstdc++ 2>/dev/null || status=1
    rm -r "$folder"
    return $status
}

# Debian's combined archive lacks glslang and SPIRV-Tools, which come in packages of their own.
has_shaderc() {
    local folder
    for folder in "${SHADERC_LIB_DIR:-}" "${VULKAN_SDK:+$VULKAN_SDK/lib}" \
        "/usr/lib/$(uname -m)-linux-gnu" /usr/lib64 /usr/lib; do
        [ -n "$folder" ] && [ -e "$folder/libshaderc_combined.a" ] || continue
        ! $debian || [ -n "${SHADERC_LIB_DIR:-}${VULKAN_SDK:-}" ] && return
        [ -e "$folder/libglslang.a" ] && [ -e "$folder/libSPIRV-Tools-opt.a" ] && return
    done
    return 1
}

builds_shaderc() {
    command -v cmake >/dev/null && command -v c++ >/dev/null && command -v git >/dev/null &&
        { command -v python3 || command -v python; } >/dev/null
}

has_loader() {
    # Not `grep -q`, which stops reading: what writes on fails then, and the pipe with it.
    { /sbin/ldconfig -p || ldconfig -p; } 2>/dev/null | grep 'libvulkan\.so\.1' >/dev/null
}

has_driver() {
    [ -n "${VK_DRIVER_FILES:-}${VK_ADD_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && return
    local file
    for file in {/etc,/usr/share,/usr/local/etc,/usr/local/share,"$HOME/.local/share"}/vulkan/icd.d/*.json; do
        [ -e "$file" ] && return
    done
    return 1
}

# The names that tests look for.
has_browser() {
    command -v chromium || command -v chromium-browser || command -v google-chrome
} >/dev/null

installed() { dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep ' installed$' >/dev/null; }

# Whether the package lists, once there are some, offer what the quick link needs: shaderc knows ray
# query from 2022.1 on.
offers_shaderc() {
    local version
    apt-cache show glslang-dev spirv-tools >/dev/null 2>&1 &&
        version=$(apt-cache policy libshaderc-dev | awk '$1 == "Candidate:" { print $2 }') &&
        dpkg --compare-versions "${version#(none)}" ge 2022.1
}

# Mesa's CPU driver has ray query from 24.1 on; Debian 12 has that in its backports only.
has_ray_query() {
    local version
    version=$(dpkg-query -W -f '${Version}' mesa-vulkan-drivers 2>/dev/null) &&
        dpkg --compare-versions "$version" ge 24.1
}

command -v cargo >/dev/null ||
    die "no Rust toolchain: \`cargo\` is not in PATH. Install Rust 1.95 or newer (rustup, or your system's package)."
if [ "$mode" = ci ]; then
    cargo fmt --version >/dev/null 2>&1 || die "the Rust toolchain lacks rustfmt"
    cargo clippy --version >/dev/null 2>&1 || die "the Rust toolchain lacks clippy"
fi

# --- Other systems --------------------------------------------------------------------------------

if ! $debian; then
    missing=()
    links || missing+=("a C and C++ compiler        Fedora: gcc-c++                Arch: gcc")
    has_shaderc || builds_shaderc ||
        missing+=("CMake, Git and Python       Fedora: cmake git python3      Arch: cmake git python")
    has_loader || missing+=("the Vulkan loader           Fedora: vulkan-loader          Arch: vulkan-icd-loader")
    has_driver || missing+=("a Vulkan driver             Fedora: mesa-vulkan-drivers    Arch: vulkan-swrast, or your GPU's")
    [ "$mode" = build ] || missing+=("Debian 12 or newer, or Ubuntu, for \`ci\`")
    if [ ${#missing[@]} -gt 0 ]; then
        say "installs on Debian and Ubuntu only, and this is ${PRETTY_NAME:-$ID}. Please install, then try again:" >&2
        printf '  %s\n' "${missing[@]}" >&2
        exit 1
    fi
    say "nothing is missing"
    exit 0
fi

# --- Debian and Ubuntu ----------------------------------------------------------------------------

quick=(libshaderc-dev glslang-dev spirv-tools)
source=(cmake g++ git python3)
lists() { apt-get indextargets 'Created-By: Packages' | grep . >/dev/null; }

packages=()
links || packages+=(g++)
if ! has_shaderc && { offers_shaderc || ! lists || ! builds_shaderc; }; then
    packages+=("${quick[@]}")
fi
has_loader || packages+=(libvulkan1)
if [ "$mode" = ci ]; then
    has_ray_query || packages+=(mesa-vulkan-drivers)
    tools=(openexr spirv-tools vulkan-validationlayers)
    has_browser || tools+=(chromium)
    [ "${VERSION_CODENAME:-}" != bookworm ] || tools+=(libllvm15) # Debian 12's own Mesa is linked with it
    for package in "${tools[@]}"; do
        installed "$package" || packages+=("$package")
    done
else
    has_driver || packages+=(mesa-vulkan-drivers)
fi
if [ ${#packages[@]} -eq 0 ]; then
    say "nothing is missing"
    exit 0
fi

root=(env DEBIAN_FRONTEND=noninteractive)
if [ "$(id -u)" -ne 0 ]; then
    by_hand="As root: apt-get install ${packages[*]}"
    command -v sudo >/dev/null || die "missing: ${packages[*]}; you are not root and there is no sudo. $by_hand"
    say "missing: ${packages[*]}; asking sudo for the right to install"
    sudo true || die "sudo refused. $by_hand"
    root=(sudo "${root[@]}")
fi
apt_get() { "${root[@]}" apt-get -qq -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=300 "$@" </dev/null; }
install() {
    apt_get install --no-install-recommends "$@" || die "could not install these packages"
}

say "refreshing the package lists"
apt_get update || say "some lists could not be refreshed; going on with what is there"

if [[ " ${packages[*]} " == *" libshaderc-dev "* ]] && ! offers_shaderc; then
    say "no usable package of shaderc here: it will be built from source, which takes minutes"
    wanted=("${source[@]}")
    for package in "${packages[@]}"; do
        [[ " ${quick[*]} " == *" $package "* ]] || wanted+=("$package")
    done
    packages=("${wanted[@]}")
fi
mapfile -t packages < <(printf '%s\n' "${packages[@]}" | sort -u)
say "installing ${packages[*]}"
install --no-upgrade "${packages[@]}"

if [ "$mode" = ci ] && ! has_ray_query && [ "${VERSION_CODENAME:-}" = bookworm ]; then
    indices() { apt-get indextargets --format '$(CODENAME) $(REPO_URI) $(COMPONENT)' 'Created-By: Packages'; }
    if ! indices | grep '^bookworm-backports ' >/dev/null; then
        mirror=$(indices | awk '$1 == "bookworm" && $3 == "main" && !uri { uri = $2 } END { print uri }')
        [ -n "$mirror" ] || die "no mirror of bookworm's main section among this machine's apt sources"
        say "adding bookworm-backports to the apt sources"
        keyring=/usr/share/keyrings/debian-archive-keyring.gpg
        echo "deb [signed-by=$keyring] $mirror bookworm-backports main" |
            "${root[@]}" tee /etc/apt/sources.list.d/bookworm-backports.list >/dev/null
        apt_get update
    fi
    say "installing mesa-vulkan-drivers of bookworm-backports"
    install -t bookworm-backports mesa-vulkan-drivers
fi

has_loader && has_driver && links && { has_shaderc || builds_shaderc; } ||
    die "the packages were installed, but not all they should bring is found"
[ "$mode" = build ] || has_ray_query || die "no Mesa with ray query (24.1 or newer) among this machine's apt sources"
