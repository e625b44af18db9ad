# The compiler's assembly, with the ends of functions replaced by jumps to the same instructions in firmware/core/ends_h8.S, and
# a call that is followed by the return by a jump. Results stay in r0 and r1, and a caller expects nothing in r2 and r3.
{ line[NR] = $0 }

END {
    for (i = 1; i <= NR; i++)
        if (line[i] == "\trts")
            shorten(i)
    for (i = 1; i <= NR; i++)
        if (line[i] != "")
            print line[i]
}

function shorten(last,    first, frame, saved) {
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
