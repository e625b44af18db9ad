# shared_parts.awk: makes the compiler's assembly smaller, by three rewrites and no others. A function's beginning that makes room for
# locals and saves r4 to r6 becomes a call of firmware/core/h8/frames.S; its end that takes this back and returns becomes a jump there;
# and a call followed by a return becomes a jump. Only these exact lines are rewritten, at a function's label and at an rts. They may be,
# because the compiler passes arguments in r0 to r2 and results in r0 and r1: r3 is free at a beginning, r2 and r3 at an end. The RCX needs
# it: without these bytes the autopilot with rotation sensors leaves less of the brick's memory than it has to spare.
# tests/gates/test_h8_shared_parts.py writes every rewrite out again and finds the compiler's text, line by line, and it counts the
# bytes that are saved; tests/vectors and the missions run the result.
{ line[NR] = $0 }

END {
    for (i = 1; i <= NR; i++) {
        if (line[i] == "\trts")
            shorten_end(i)
        if (line[i] == "\tmov.w\tr6,@-r7" && line[i - 1] == "\tmov.w\tr5,@-r7" && line[i - 2] == "\tmov.w\tr4,@-r7")
            shorten_beginning(i)
    }
    for (i = 1; i <= NR; i++)
        if (line[i] != "")
            print line[i]
}

function shorten_beginning(last,    first, frame) {
    first = last - 2
    for (frame = 0; line[first - 1] == "\tsubs\t#2,r7"; first--)
        frame += 2
    if (line[first - 1] == "\tadd.w\tr3,r7" && line[first - 2] ~ /^\tmov\.w\t#-[0-9]+,r3$/) {
        frame = substr(line[first - 2], index(line[first - 2], "-") + 1) + 0
        first -= 2
    }
    if (line[first - 1] !~ /^_.*:$/)
        return
    if (frame == 0)
        replace(first, last, "\tjsr\t@_begin_saved")
    else if (frame < 256)
        replace(first, last, "\tmov.b\t#" frame ",r3l\n\tjsr\t@_begin_saved_framed")
}

function shorten_end(last,    first, frame, saved) {
    first = last
    for (frame = 0; line[first - 1] == "\tadds\t#2,r7"; first--)
        frame += 2
    if (line[first - 1] == "\tadd.w\tr3,r7" && line[first - 2] ~ /^\tmov\.w\t#[0-9]+,r3$/) {
        frame = substr(line[first - 2], index(line[first - 2], "#") + 1) + 0
        first -= 2
    }
    for (saved = ""; line[first - 1] ~ /^\tmov\.w\t@r7\+,r[456]$/; first--)
        saved = substr(line[first - 1], 13) saved

    if (saved == "r6r5r4" && frame > 0 && frame < 256) {
        replace(first, last, "\tmov.b\t#" frame ",r2l\n\tjmp\t@_end_saved_framed")
    } else if (saved == "r6r5r4" && frame == 0) {
        replace(first, last, "\tjmp\t@_end_saved")
    } else if (saved == "r5r4" && frame == 0) {
        replace(first, last, "\tjmp\t@_end_two_saved")
    } else if (first == last && line[first - 1] ~ /^\tjsr\t@_/) {
        sub("jsr", "jmp", line[first - 1])
        line[last] = ""
    }
}

function replace(first, last, by) {
    line[first] = by
    while (first < last)
        line[++first] = ""
}
