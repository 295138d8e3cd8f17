/* Flight software in C: keeps the lidar's boresight on a tumbling stage, over the socket of `rso-lidar serve`.
 *
 *   cc -std=c99 -Wall -Wextra -O2 pointing.c -o pointing -lzmq -lm
 *   rso-lidar serve tumbling_stage.toml &
 *   ./pointing tcp://127.0.0.1:5571           (heads of replies in JSON)
 *   ./pointing tcp://127.0.0.1:5571 struct    (heads of replies as structures, for processors without a JSON parser)
 *
 * zmq.h is in libzmq3-dev (Debian, Ubuntu), zeromq-devel (Fedora) or zeromq (Homebrew).
 *
 * The protocol is in docs/protocol.md. After each flash the program takes the mean direction of the returns whose range is
 * near the median range, and commands the pan and tilt that bring the boresight there. It prints a line for each flash:
 * time [s], returns, and the angle between boresight and target [deg]. At the end of the scenario it shuts the server down.
 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zmq.h>

#include "struct_head.h"

#define MOST_PARTS 64
#define TIMEOUT_MS 60000
#define GATE_M 15.0 /* about the size of the target */
#define LEAST_RETURNS 4

static void fail(const char *what, const char *why) {
    fprintf(stderr, "pointing: %s: %s\n", what, why);
    exit(1);
}

/* ---- JSON, as much of it as the headers need: objects, arrays, numbers, texts, true, false, null ------------------- */

static const char *skip_blanks(const char *at, const char *end) {
    while (at < end && strchr(" \t\r\n", *at)) at++;
    return at;
}

/* Return the end of the value that begins at `at`. */
static const char *skip_value(const char *at, const char *end) {
    int depth = 0;
    do {
        at = skip_blanks(at, end);
        if (at >= end) fail("reply", "its header is cut short");
        if (*at == '"') {
            for (at++; at < end && *at != '"'; at++)
                if (*at == '\\') at++;
            at++;
        } else if (*at == '{' || *at == '[') {
            depth++, at++;
        } else if (*at == '}' || *at == ']') {
            depth--, at++;
        } else if (*at == ',' || *at == ':') {
            at++;
        } else {
            while (at < end && !strchr(",:]} \t\r\n", *at)) at++;
        }
    } while (depth > 0);
    return at;
}

/* Return the value of a key of the object that begins at `at`, or NULL. */
static const char *find_key(const char *at, const char *end, const char *key) {
    size_t length = strlen(key);
    at = skip_blanks(at, end);
    if (at >= end || *at != '{') return NULL;
    for (at = skip_blanks(at + 1, end); at < end && *at == '"';) {
        const char *name = at + 1, *after = skip_value(at, end);
        const char *value = skip_blanks(after, end);
        if (value >= end || *value != ':') fail("reply", "its header is no JSON");
        value = skip_blanks(value + 1, end);
        if ((size_t)(after - 1 - name) == length && !memcmp(name, key, length)) return value;
        at = skip_blanks(skip_value(value, end), end);
        if (at < end && *at == ',') at = skip_blanks(at + 1, end);
    }
    return NULL;
}

static int is_text(const char *value, const char *end, const char *text) {
    size_t length = strlen(text);
    return value && (size_t)(end - value) > length + 1 && *value == '"' && !memcmp(value + 1, text, length)
        && value[length + 1] == '"';
}

static int is_true(const char *value) { return value && *value == 't'; }

/* ---- messages ------------------------------------------------------------------------------------------------------ */

struct reply {
    zmq_msg_t parts[MOST_PARTS];
    int count;
    const char *header, *end;
    const struct rso_head *head; /* NULL where the head is JSON */
};

static long long sequence;

static void release(struct reply *reply) {
    for (int k = 0; k < reply->count; k++) zmq_msg_close(&reply->parts[k]);
    reply->count = 0;
}

/* Send a request and receive its reply. `fields` is JSON without the braces, such as "\"version\": 1". */
static void ask(void *socket, struct reply *reply, const char *kind, const char *fields, ...) {
    char more[512], text[768];
    va_list given;
    va_start(given, fields);
    vsnprintf(more, sizeof more, fields, given);
    va_end(given);
    int length = snprintf(text, sizeof text, "{\"request\": \"%s\", \"sequence\": %lld%s%s}", kind, ++sequence,
                          *more ? ", " : "", more);
    if (zmq_send(socket, text, (size_t)length, 0) < 0) fail(kind, zmq_strerror(errno));
    int more_follow = 1;
    for (reply->count = 0; more_follow && reply->count < MOST_PARTS; reply->count++) {
        zmq_msg_t *part = &reply->parts[reply->count];
        zmq_msg_init(part);
        if (zmq_msg_recv(part, socket, 0) < 0)
            fail(kind, errno == EAGAIN ? "no answer; see whether the server runs" : zmq_strerror(errno));
        more_follow = zmq_msg_more(part);
    }
    if (more_follow) fail(kind, "the reply has more parts than this program takes");
    reply->header = zmq_msg_data(&reply->parts[0]);
    reply->end = reply->header + zmq_msg_size(&reply->parts[0]);
    reply->head = NULL;
    if (zmq_msg_size(&reply->parts[0]) >= sizeof(struct rso_head) && !memcmp(reply->header, "RSOL", 4)) {
        reply->head = (const struct rso_head *)reply->header;
        if (!(reply->head->flags & RSO_OK)) fail(kind, reply->header + reply->head->error_at);
        return;
    }
    if (!is_true(find_key(reply->header, reply->end, "ok"))) {
        const char *error = find_key(reply->header, reply->end, "error");
        const char *message = error ? find_key(error, reply->end, "message") : NULL;
        const char *stop = message ? skip_value(message, reply->end) : NULL;
        fprintf(stderr, "pointing: %s: %.*s\n", kind, message ? (int)(stop - message) : 8, message ? message : "no reply");
        exit(1);
    }
}

/* Return the values of an array of a reply and its number of values, or NULL. The bytes are little-endian, as here. */
static const void *find_array(struct reply *reply, const char *name, const char *dtype, size_t *count) {
    if (reply->head) {
        const struct rso_array *arrays = (const struct rso_array *)(reply->head + 1);
        for (uint32_t k = 0; k < reply->head->n_arrays; k++) {
            if (strcmp(reply->header + arrays[k].name_at, name)) continue;
            if (strncmp(arrays[k].dtype, dtype, 4)) fail(name, "has another dtype");
            *count = zmq_msg_size(&reply->parts[arrays[k].part]) / (size_t)(dtype[2] - '0');
            return zmq_msg_data(&reply->parts[arrays[k].part]);
        }
        return NULL;
    }
    const char *entry = find_key(reply->header, reply->end, "arrays");
    if (!entry) return NULL;
    entry = skip_blanks(entry + 1, reply->end);
    for (int k = 1; k < reply->count && entry < reply->end && *entry == '{'; k++) {
        if (is_text(find_key(entry, reply->end, "name"), reply->end, name)) {
            if (!is_text(find_key(entry, reply->end, "dtype"), reply->end, dtype)) fail(name, "has another dtype");
            *count = zmq_msg_size(&reply->parts[k]) / (size_t)(dtype[2] - '0');
            return zmq_msg_data(&reply->parts[k]);
        }
        entry = skip_blanks(skip_value(entry, reply->end), reply->end);
        if (entry < reply->end && *entry == ',') entry = skip_blanks(entry + 1, reply->end);
    }
    return NULL;
}

static int is_over(struct reply *reply) {
    if (reply->head) return !!(reply->head->flags & RSO_OVER);
    return is_true(find_key(reply->header, reply->end, "is_over"));
}

/* Return the time of the flash of a reply that holds a reading [s]. */
static double find_time_s(struct reply *reply) {
    if (reply->head) return 1e-9 * (double)reply->head->t_emission_ns;
    return strtod(find_key(find_key(reply->header, reply->end, "frame"), reply->end, "time_s"), NULL);
}

/* ---- the controller ------------------------------------------------------------------------------------------------ */

static int compare(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Find the mean direction of the target in lidar axes (x right, y down, z ahead); return the number of its returns. */
static size_t find_target(const float *range_m, const double *sight, size_t pixels, float *sorted, double toward[3]) {
    size_t returns = 0, used = 0;
    for (size_t k = 0; k < pixels; k++)
        if (!isnan(range_m[k])) sorted[returns++] = range_m[k];
    if (returns < LEAST_RETURNS) return 0;
    qsort(sorted, returns, sizeof *sorted, compare);
    double median_m = sorted[returns / 2];
    toward[0] = toward[1] = toward[2] = 0.0;
    for (size_t k = 0; k < pixels; k++) {
        if (isnan(range_m[k]) || fabs(range_m[k] - median_m) > GATE_M) continue;
        for (int axis = 0; axis < 3; axis++) toward[axis] += sight[3 * k + axis];
        used++;
    }
    return used >= LEAST_RETURNS ? used : 0;
}

int main(int argc, char **argv) {
    void *context = zmq_ctx_new(), *socket = zmq_socket(context, ZMQ_REQ);
    int timeout_ms = TIMEOUT_MS, linger_ms = 0;
    zmq_setsockopt(socket, ZMQ_RCVTIMEO, &timeout_ms, sizeof timeout_ms);
    zmq_setsockopt(socket, ZMQ_LINGER, &linger_ms, sizeof linger_ms);
    if (zmq_connect(socket, argc > 1 ? argv[1] : "tcp://127.0.0.1:5571")) fail("connect", zmq_strerror(errno));

    struct reply reply;
    ask(socket, &reply, "hello", "\"version\": 1, \"client\": \"pointing.c\", \"head\": \"%s\"", argc > 2 ? argv[2] : "json");
    release(&reply);

    double *sight = NULL, pan_rad = 0.0, tilt_rad = 0.0;
    float *sorted = NULL;
    size_t pixels = 0;
    int has_command = 0;
    for (;;) {
        if (has_command)
            ask(socket, &reply, "step", "\"command\": {\"pan_rad\": %.17g, \"tilt_rad\": %.17g}", pan_rad, tilt_rad);
        else
            ask(socket, &reply, "step", "%s", "");
        int was_last = is_over(&reply);
        size_t count, angles;
        const double *new_sight = find_array(&reply, "line_of_sight", "<f8", &count);
        if (new_sight) { /* it comes with the first reading, and when the lens changes */
            pixels = count / 3;
            sight = realloc(sight, count * sizeof *sight);
            sorted = realloc(sorted, pixels * sizeof *sorted);
            if (!sight || !sorted) fail("memory", "there is not enough");
            memcpy(sight, new_sight, count * sizeof *sight);
        }
        const float *range_m = find_array(&reply, "reading/range_m", "<f4", &count);
        const double *measured = find_array(&reply, "pan_tilt_rad", "<f8", &angles);
        double toward[3];
        if (range_m && measured && sight && count == pixels) { /* a lost reading has none, and the last command stays */
            size_t returns = find_target(range_m, sight, pixels, sorted, toward);
            double time_s = find_time_s(&reply);
            if (returns) {
                /* PTU axes at the measured angles: x ahead, y left, z up. First turn by tilt, then by pan. */
                double x = toward[2], y = -toward[0], z = -toward[1];
                double ahead = x * cos(measured[1]) - z * sin(measured[1]);
                double up = x * sin(measured[1]) + z * cos(measured[1]);
                pan_rad = measured[0] + atan2(y, ahead);
                tilt_rad = atan2(up, hypot(ahead, y));
                has_command = 1;
                printf("%.3f %zu %.4f\n", time_s, returns,
                       atan2(hypot(toward[0], toward[1]), toward[2]) * 57.29577951308232);
            } else {
                printf("%.3f 0 nan\n", time_s);
            }
        }
        release(&reply);
        if (was_last) break;
    }
    ask(socket, &reply, "shutdown", "%s", "");
    release(&reply);
    free(sight);
    free(sorted);
    zmq_close(socket);
    zmq_ctx_term(context);
    return 0;
}
