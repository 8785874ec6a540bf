// A digit of a stable radix sort: how often each digit occurs in each run of records, where those of a run go, and there they go.
//
// `counts` has a number for each run, digit after digit, so that its sums are places; above it, level by level, the sums of blocks.

@group(0) @binding(1) var<storage, read_write> counts: array<u32>;

// Which of the 256 digits a record has. None crosses the words of a key.
fn digit_of(record: vec4u) -> u32 {
    let word = select(record.x, record.y, task.bit >= 32u);
    return (word >> (task.bit & 31u)) & 255u;
}

var<workgroup> tally: array<atomic<u32>, 256>;

// A run a workgroup.
@compute @workgroup_size(256)
fn count_digits(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let run = task.first + group.x;
    atomicStore(&tally[thread], 0u);
    workgroupBarrier();
    for (var round = 0u; round < ROUNDS; round += 1u) {
        let at = 256u * (ROUNDS * run + round) + thread;
        if at < task.count {
            atomicAdd(&tally[digit_of(sorted(at))], 1u);
        }
    }
    workgroupBarrier();
    counts[thread * task.runs + run] = atomicLoad(&tally[thread]);
}

var<workgroup> sums: array<u32, 256>;

// The sum of what the threads before have; of the last one, what comes after it.
fn sum_before(own: u32, thread: u32) -> vec2u {
    sums[thread] = own;
    workgroupBarrier();
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        var more = 0u;
        if thread >= reach {
            more = sums[thread - reach];
        }
        workgroupBarrier();
        sums[thread] += more;
        workgroupBarrier();
    }
    return vec2u(sums[thread] - own, sums[255]);
}

// Sums of the counts before each, within blocks of 2048, and of each block.
@compute @workgroup_size(256)
fn sum_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let block = task.first + group.x;
    let first = 8u * (256u * block + thread);
    var own: array<u32, 8>;
    var total = 0u;
    for (var k = 0u; k < 8u; k += 1u) {
        own[k] = total;
        if first + k < task.count {
            total += counts[task.level + first + k];
        }
    }
    let before = sum_before(total, thread);
    for (var k = 0u; k < 8u; k += 1u) {
        if first + k < task.count {
            counts[task.level + first + k] = before.x + own[k];
        }
    }
    if thread == 0u {
        counts[task.next_level + block] = before.y;
    }
}

// Adds what comes before each block.
@compute @workgroup_size(256)
fn add_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let block = task.first + group.x;
    let first = 8u * (256u * block + thread);
    let before = counts[task.next_level + block];
    for (var k = 0u; k < 8u; k += 1u) {
        if first + k < task.count {
            counts[task.level + first + k] += before;
        }
    }
}

// Where the next record with each digit goes.
var<workgroup> next: array<u32, 256>;
// Of each digit, which threads have it: eight words, each for all digits.
var<workgroup> owners: array<atomic<u32>, 2048>;

@compute @workgroup_size(256)
fn scatter_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let run = task.first + group.x;
    next[thread] = counts[thread * task.runs + run];
    for (var word = 0u; word < 8u; word += 1u) {
        atomicStore(&owners[256u * word + thread], 0u);
    }
    let own_word = thread >> 5u;
    let own_bit = 1u << (thread & 31u);
    for (var round = 0u; round < ROUNDS; round += 1u) {
        let at = 256u * (ROUNDS * run + round) + thread;
        let is_there = at < task.count;
        var record = vec4u();
        var digit = 0u;
        workgroupBarrier();
        if is_there {
            record = sorted(at);
            digit = digit_of(record);
            atomicOr(&owners[256u * own_word + digit], own_bit);
        }
        workgroupBarrier();
        // Records with the same digit go in the order of their threads.
        var before = 0u;
        var all = 0u;
        for (var word = 0u; word < 8u; word += 1u) {
            let mask = atomicLoad(&owners[256u * word + digit]);
            let earlier = select(select(0u, own_bit - 1u, word == own_word), 0xffffffffu, word < own_word);
            before += countOneBits(mask & earlier);
            all += countOneBits(mask);
        }
        let place = next[digit] + before;
        workgroupBarrier();
        if is_there {
            set_records(place, record);
            atomicStore(&owners[256u * own_word + digit], 0u);
            if before + 1u == all {
                next[digit] = place + 1u;
            }
        }
    }
}
