# Sourced by the other scripts: a virtual environment of the project's own with the locked versions, made once.
# Nothing is installed outside .venv, except the system packages named by the caller through `system_packages`.
# shellcheck shell=bash

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv="$root/.venv"

fail() { echo "finback: $*" >&2; exit 2; }

find_python() {
  local candidate
  for candidate in "${FINBACK_PYTHON:-}" python3.11 python3.12 python3.13 python3.14 python3 python; do
    [ -n "$candidate" ] || continue
    if command -v "$candidate" >/dev/null 2>&1 \
      && "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
      echo "$candidate"
      return 0
    fi
  done
  return 1
}

# system_packages NAME...: Debian packages that are not Python's to install; says how where it may not install them.
system_packages() {
  local missing=() name
  command -v dpkg-query >/dev/null 2>&1 || { echo "finback: not a Debian system; make sure these are there: $*" >&2; return 0; }
  for name in "$@"; do
    [ "$(dpkg-query -W -f='${Status}' "$name" 2>/dev/null)" = "install ok installed" ] || missing+=("$name")
  done
  [ ${#missing[@]} -eq 0 ] && return 0
  [ "$(id -u)" -eq 0 ] || fail "please install the system packages: ${missing[*]} (apt-get install ${missing[*]})"
  apt-get update -qq >&2 && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >&2 \
    || fail "could not install the system packages: ${missing[*]}"
}

# fresh EXTRA...: whether .venv holds the locked versions with these extras; sets $wanted and $stamp.
fresh() {
  wanted=$(cat "$root/pyproject.toml" "$root/constraints.txt" <(echo "$root $*") | sha256sum | cut -d' ' -f1)
  stamp="$venv/.finback-$(IFS=-; echo "${*:-user}")"
  [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ] && "$venv/bin/python" -c '' 2>/dev/null
}

# environment EXTRA...: make or refresh .venv; quick when nothing changed. With `dev` all is there that a user needs.
# Extras add up: what one script installed stays for the others.
environment() {
  local wanted stamp python extras=""
  if ! { [ $# -eq 0 ] && fresh dev; } && ! fresh "$@"; then
    if ! "$venv/bin/python" -c '' 2>/dev/null; then
      python=$(find_python) || { system_packages python3-venv; python=$(find_python); } \
        || fail "Python 3.11 or newer (with venv) is needed; set FINBACK_PYTHON to one"
      rm -rf "$venv"
      "$python" -m venv "$venv" || fail "could not make the virtual environment $venv"
    fi
    [ $# -eq 0 ] || extras="[$(IFS=,; echo "$*")]"
    echo "finback: installing the locked versions into .venv (once) ..." >&2
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --constraint "$root/constraints.txt" \
      --editable "$root$extras" >&2 || fail "the installation failed (see above)"
    echo "$wanted" >"$stamp"
  fi
  export PATH="$venv/bin:$PATH" VIRTUAL_ENV="$venv"
}
