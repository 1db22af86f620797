#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# run.sh install|PART [VIDEO [SEED]]    one part of ./scripts/blender, inside the Debian, in /scope.
set -euo pipefail
cd /scope
log=out/$1.log

# A part's home is a copy of the installed one, mounted over it: compiled code is bound to the path of its source. It
# begins with the code that other parts have compiled by then.
separate_home() {
    local own=homes/$1 compiled
    mkdir -p homes
    rm -rf "$own"
    cp -al home "$own"
    find "$own" -name userpref.blend -exec cp {} {}.own \; -exec mv {}.own {} \;
    [ "$1" != first ] || find "$own" -path '*/.user/*' -name kernels -prune -exec rm -rf {} +
    [ "$1" = first ] || while read -r compiled; do
        mkdir -p "$own/${compiled#homes/*/}"
        cp -rn "$compiled/." "$own/${compiled#homes/*/}" || true # what is being written is compiled once more
    done < <(find homes -path "homes/$1" -prune -o -path '*/.user/*' -name kernels -print -prune)
    mount --bind "$own" home
}

on_screen() { # a command, with a separate virtual screen
    local status=0
    Xvfb :7 -screen 0 1600x1000x24 >/dev/null 2>&1 &
    local screen=$!
    until [ -S /tmp/.X11-unix/X7 ]; do # which it makes once it is ready
        kill -0 $screen 2>/dev/null || { echo "run.sh: Xvfb has ended" >&2; return 1; }
        sleep 0.1
    done
    DISPLAY=:7 timeout -k 10 1500 "$@" >"$log" 2>&1 || status=$?
    kill $screen
    [ $status = 0 ] || tail -n 150 "$log" >&2
    return $status
}

in_window() { # a script below this folder in a Blender
    local script=$1
    shift
    on_screen blender --python-exit-code 1 --python "parts/$script" -- "$@"
}

case $1 in install | startup | update) ;; *) separate_home "$1" ;; esac
case $1 in
    install)
        blender --background --command extension install-file --repo user_default --enable scope.zip >"$log" 2>&1 ||
            { cat "$log" >&2; exit 1; }
        ;;
    panel | tour) in_window "window/$1.py" "/scope/$2" /scope/out ;;
    undo | trouble | stored | pins | details | reload) in_window "window/$1.py" /scope/clips/walk.mp4 /scope/out ;;
    live) in_window live/live.py /scope/clips/walk.mp4 /scope/out ;;
    startup) on_screen python3 parts/window/startup.py 15 ;;
    walk) on_screen python3 parts/walk/start.py "$3" ;;
    first) # on a computer without the cache of earlier captures
        status=0
        blender --background --python-exit-code 1 --python parts/without_window/first_capture.py >"$log" 2>&1 || status=$?
        [ $status = 0 ] || tail -n 40 "$log" >&2
        exit $status
        ;;
    update)
        python3 parts/without_window/update.py scope.zip >"$log" 2>&1 || { tail -n 60 "$log" >&2; exit 1; }
        ;;
    headless) python3 parts/without_window/headless.py 2>&1 | tee "$log" >&2 ;;
    *) echo "run.sh: no part '$1'; there are panel, headless, undo, trouble, stored, pins, details, live, first, update, startup, reload, walk and tour" >&2; exit 2 ;;
esac
