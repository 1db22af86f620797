#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# run.sh install|panel|undo|trouble|pins|headless|startup [VIDEO]    one part of ./scripts/blender, inside the Debian, in /scope.
set -euo pipefail
cd /scope
log=out/$1.log

on_screen() { # a command, with a separate virtual screen
    local status=0
    Xvfb :7 -screen 0 1600x1000x24 >/dev/null 2>&1 &
    local screen=$!
    sleep 2
    DISPLAY=:7 timeout -k 10 1500 "$@" >"$log" 2>&1 || status=$?
    kill $screen
    [ $status = 0 ] || tail -n 40 "$log" >&2
    return $status
}

in_window() { # a script of this folder in a Blender
    local script=$1
    shift
    on_screen blender --python-exit-code 1 --python "parts/$script" -- "$@"
}

case $1 in
    install)
        blender --background --command extension install-file --repo user_default --enable scope.zip >"$log" 2>&1 ||
            { cat "$log" >&2; exit 1; }
        ;;
    panel) in_window panel.py "/scope/$2" /scope/out ;;
    undo | trouble | pins) in_window "$1.py" /scope/clips/walk.mp4 /scope/out ;;
    startup) on_screen python3 parts/startup.py 15 ;;
    headless) python3 parts/headless.py 2>&1 | tee "$log" >&2 ;;
    *) echo "run.sh: no part '$1'; there are panel, undo, trouble, pins, headless and startup" >&2; exit 2 ;;
esac
