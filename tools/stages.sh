# shellcheck shell=bash
# Stages of tests: compiled once, run several programs at once, counted. Sourced after common.sh by scripts that set LOGS, the
# folder of all logs.

# The number of test programs that run at once: they mostly wait, for peers and for clocks.
AT_ONCE=3
# A program that runs the programs of another platform, with its arguments.
RUNNER=()
# Packages and programs with tests that must answer within milliseconds, and how these run.
IN_TIME='^$'
AT_ITS_TIME=()
# The folders with the reports of JUnit, as a pattern.
JAVA_REPORTS='java/*/target/surefire-reports'

# wait_for STAGE: waits for a stage of another lane, whatever its result.
wait_for() {
    until [ -f "$LOGS/$1.result" ]; do
        sleep 0.5
    done
}

# compile LIST OPTION...: compiles tests by the function cargo_test, and writes them to LIST.built among the logs, one per line:
# the folder of the package, kind:name of the target, and the program. Stages that run meanwhile, many of them in real time, have priority.
compile() {
    local list=$1
    shift
    (
        renice -n 10 "$BASHPID" >/dev/null 2>&1 || true
        cargo_test --no-run --message-format json-render-diagnostics "$@"
    ) | sed -nE -e 's/","target":\{"kind":\["([a-z]*).*"name":"([^"]*)".*"test":true\},"features".*"executable":"/\t\1:\2\t/' \
        -e 's/.*"manifest_path":"(.*)\/Cargo\.toml(\t.*\t[^"]*)".*/\1\2/p' >"$LOGS/$list.built"
}

# Sets the array way to the command that the program of a folder is run by.
way_of() {
    way=()
    # One of these at a time: in real time they would keep each other waiting.
    [[ ! $1 =~ $IN_TIME ]] || way=(flock -o "$ROOT/$LOGS/in_time" "${AT_ITS_TIME[@]}")
}

# run_compiled LIST PATTERN [ARGUMENT...]: runs the programs of a list whose kind:name matches, like cargo, but several at
# once. What fails runs again alone, since a program that shares two cores with others, or with a compiler, may miss a deadline;
# the end of the whole run names it. The output of failing programs comes last.
run_compiled() {
    local list=$LOGS/$1.built pattern=$2 folder program name way running=0 said failed
    shift 2
    said=$(mktemp -d "$LOGS/said.XXXXXX")
    failed=$said/failed
    mkdir "$failed"
    # Those with peers first, which take longest.
    while IFS=$'\t' read -r _ folder program; do
        if [ "$running" = "$AT_ONCE" ]; then
            wait -n || true
        else
            running=$((running + 1))
        fi
        name=${program##*/}
        way_of "${folder#"$ROOT"}/$name"
        {
            (echo "     Running $program" && cd "$folder" && exec "${way[@]}" "${RUNNER[@]}" "$program" "$@") >"$said/$name" 2>&1 </dev/null ||
                mv "$said/$name" "$failed/"
        } &
    done < <(awk -F '\t' -v pattern="$pattern" '$2 ~ pattern { print ($2 !~ /:foreign/ && $1 !~ /profibus/) "\t" $1 "\t" $3 }' "$list" | sort)
    wait
    again_alone "$list" "$said" "$@"
    find "$said" -maxdepth 1 -type f -exec cat {} +
    find "$failed" -type f -exec cat {} +
    [ -z "$(ls "$failed")" ] || return 1
    rm -r "$said"
}

# again_alone LIST FOLDER [ARGUMENT...]: runs the failed tests of failed programs again, one program after the other. The output of
# a program whose tests then pass moves from FOLDER/failed to FOLDER, with that of the second run.
again_alone() {
    local list=$1 said=$2 folder program name way tests
    shift 2
    [[ " $* " == *" --exact "* ]] || set -- "$@" --exact
    while IFS=$'\t' read -r folder _ program; do
        name=${program##*/}
        [ -f "$said/failed/$name" ] || continue
        way_of "${folder#"$ROOT"}/$name"
        # None where the program was ended in the middle of a test: then all of them.
        mapfile -t tests < <(sed -nE 's/^test (.*) \.\.\. FAILED$/\1/p' "$said/failed/$name")
        (cd "$folder" && exec "${way[@]}" "${RUNNER[@]}" "$program" "$@" "${tests[@]}") >"$said/again" 2>&1 </dev/null || continue
        # Those that passed at once still count.
        [ ${#tests[@]} = 0 ] || sed -E 's/^test result: FAILED\. ([0-9]+) passed; [0-9]+ failed;/test result: the others ok. \1 passed; 0 failed;/' \
            "$said/failed/$name" >"$said/$name"
        {
            cat "$said/again"
            printf 'passed only alone: %s\n' "${tests[@]:-$name}"
        } >>"$said/$name"
        rm "$said/failed/$name"
    done <"$list"
    rm -f "$said/again"
}

# Passed, failed and skipped tests in the logs of cargo.
cargo_counts() {
    awk '/^test result:/ { for (i = 2; i <= NF; i++) { if ($i == "passed;") p += $(i-1)
             if ($i == "failed;") f += $(i-1)
             if ($i == "ignored;") s += $(i-1) } }
         END { print p + 0, f + 0, s + 0 }' "$1"
}

# The same from the reports of Surefire.
surefire_counts() {
    # shellcheck disable=SC2086 # a pattern
    find $JAVA_REPORTS -name 'TEST-*.xml' -exec cat {} + 2>/dev/null |
        awk 'function value(name,   text) {
                 if (!match($0, " " name "=\"[0-9]+\"")) return 0
                 text = substr($0, RSTART, RLENGTH); gsub(/[^0-9]/, "", text); return text }
             /<testsuite / { t += value("tests"); f += value("failures") + value("errors"); s += value("skipped") }
             END { print t - f - s, f + 0, s + 0 }'
}

# The tests that passed only when Surefire ran them again, as again_alone tells them.
surefire_again() {
    # shellcheck disable=SC2086 # the reports are a pattern
    find $JAVA_REPORTS -name 'TEST-*.xml' -exec cat {} + 2>/dev/null |
        awk '/<testcase / { name = $0; sub(/.* classname="/, "", name); sub(/".*/, "", name)
                 test = $0; sub(/.*<testcase name="/, "", test); sub(/".*/, "", test) }
             /<flaky(Failure|Error)/ && !told[name, test]++ { print "passed only alone: " name "." test }'
}

# The same from the last line of pytest.
pytest_counts() {
    awk '/^=+ .*(passed|failed|error|skipped).* in [0-9.]+s/ { p = f = s = 0
             for (i = 2; i <= NF; i++) { word = $i; sub(/,$/, "", word)
                 if (word == "passed") p = $(i-1)
                 if (word ~ /^(failed|errors?)$/) f += $(i-1)
                 if (word == "skipped") s = $(i-1) } }
         END { print p + 0, f + 0, s + 0 }' "$1"
}

# Tests that were skipped one by one, with their reasons.
skipped_tests() {
    sed -nE 's/^test ([^ ]+) \.\.\. ignored(, )?(.*)/\1: \3/p; s/^SKIPPED \[[0-9]+\] ([^ ]+): (.*)/\1: \2/p' "$LOGS"/*.log
    # shellcheck disable=SC2086 # a pattern
    find $JAVA_REPORTS -name 'TEST-*.xml' -exec cat {} + 2>/dev/null |
        awk '/<testcase / { name = $0; sub(/.* classname="/, "", name); sub(/".*/, "", name)
                 test = $0; sub(/.*<testcase name="/, "", test); sub(/".*/, "", test) }
             /<skipped/ { reason = $0; if (!sub(/.*message="/, "", reason)) reason = ""; sub(/".*/, "", reason)
                 print name "." test ": " reason }'
}

# failures FUNCTION: what the log of a failed stage says of its failed tests, or else its last lines.
failures() {
    local told
    told=$(awk '/^---- .* stdout ----$/ { print $2; next }
        /panicked at / { lines = 4 }
        lines-- > 0 { print "    " $0; next }
        /^(FAILED|ERROR) .* - / || /^\[ERROR\]   / || /^  JUnit Jupiter:/ || /^    => / { print }' "$LOGS/$1.log")
    printf '%s\n' "${told:-$(tail -n 5 "$LOGS/$1.log")}" | cut -c -300
}

# Sums the processor time of a stage and its commands from the lines of `times`. Lanes wait for one another, so this is what
# a stage costs, and its duration is not.
processor_seconds() {
    tr ' ' '\n' | awk -F '[ms]' 'NF > 1 { all += $1 * 60 + $2 } END { printf "%d\n", all }'
}

passed=0 failed=0 skipped=0
table=()
named_skips=()
named_failures=()

# stage HEADING FUNCTION [surefire | pytest]: runs one stage, and writes its result to a .result file and its messages to a
# .said file.
stage() {
    local heading=$1 function=$2 log=$LOGS/$2.log start=$SECONDS code p f s
    echo "== $heading"
    set +e
    (
        set -e
        # Wherever the stage has gone.
        trap 'times >"$ROOT/$LOGS/$function.times"' EXIT
        "$function"
    ) >"$log" 2>&1 </dev/null
    code=$?
    set -e
    case ${3:-} in
        surefire) read -r p f s < <(surefire_counts) ;;
        pytest) read -r p f s < <(pytest_counts "$log") ;;
        *) read -r p f s < <(cargo_counts "$log") ;;
    esac
    local verdict=ok
    : >"$LOGS/$function.said"
    # shellcheck disable=SC2153 # of common.sh
    case $code in
        0)
            if [ $((p + f + s)) -gt 0 ]; then
                :
            elif grep -q '^test result:' "$log"; then
                # A filter that no longer matches anything proves nothing.
                verdict=FAILED f=1
                echo "no test ran (the whole of it: $log)" >"$LOGS/$function.said"
            else
                p=1
            fi
            ;;
        "$SKIPPED")
            verdict=skipped
            s=$((s + 1))
            ;;
        *)
            verdict=FAILED
            [ "$f" -gt 0 ] || f=1
            {
                tail -n 200 "$log"
                echo "(the whole of it: $log)"
            } >"$LOGS/$function.said"
            ;;
    esac
    printf '%s\t%d\t%d\t%d\t%d\t%d\t%s\n' "$verdict" "$p" "$f" "$s" $((SECONDS - start)) \
        "$(processor_seconds <"$LOGS/$function.times")" "$heading" >"$LOGS/$function.result"
    cat "$LOGS/$function.said"
    printf '== %s: %s, %d s: %d passed, %d failed, %d skipped\n' "$heading" "$verdict" $((SECONDS - start)) "$p" "$f" "$s"
}

# Adds the result of a stage to the table.
account() {
    local function=$1 verdict p f s seconds processor heading
    if [ ! -f "$LOGS/$function.result" ]; then
        table+=("$(printf '%-34s %-8s' "$function" "NOT RUN")")
        failed=$((failed + 1))
        return
    fi
    IFS=$'\t' read -r verdict p f s seconds processor heading <"$LOGS/$function.result"
    case $verdict in
        skipped) named_skips+=("$heading: $(tail -n 1 "$LOGS/$function.log")") ;;
        FAILED) named_failures+=("$heading:" "$(failures "$function")") ;;
    esac
    table+=("$(printf '%-34s %-8s %6d %6d %7d %5d s %7d s' "$heading" "$verdict" "$p" "$f" "$s" "$seconds" \
        "$processor")")
    passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
}

# conclude WHAT FUNCTION...: prints the table of these stages, what was skipped or passed only alone, what failed and why, and the
# counts. Fails if a stage did.
conclude() {
    local what=$1 function line
    shift
    for function in "$@"; do
        account "$function"
    done
    printf '\n%-34s %-8s %6s %6s %7s %7s %9s\n' stage "" passed failed skipped time processor
    printf '%s\n' "${table[@]}"
    while read -r line; do
        named_skips+=("$line")
    done < <(skipped_tests)
    if [ ${#named_skips[@]} -gt 0 ]; then
        printf '\nskipped:\n'
        printf '  %s\n' "${named_skips[@]}"
    fi
    if cat "$LOGS"/*.log | sed -n 's/^passed only alone: /  /p' | grep . >"$LOGS/alone"; then
        printf '\nfailed beside others, and passed alone:\n'
        cat "$LOGS/alone"
    fi
    if [ ${#named_failures[@]} -gt 0 ]; then
        printf '\nfailed:\n'
        printf '%s\n' "${named_failures[@]}"
    fi
    printf '\n%s: %d passed, %d failed, %d skipped\n' "$what" "$passed" "$failed" "$skipped"
    [ "$failed" = 0 ]
}
