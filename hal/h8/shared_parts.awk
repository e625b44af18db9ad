# Makes the compiler's assembly smaller: the beginnings and ends that many functions have in common become jumps to
# firmware/core/h8/frames.S, and a call followed by a return becomes a jump.
# Registers at these places: arguments are in r0 to r2 and results in r0 and r1, so that r3 is free at a beginning, r2 and
# r3 at an end.
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
