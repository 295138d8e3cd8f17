/* The head of a reply of `rso-lidar serve` as structures, which a client asks for with "head": "struct" in its hello.
 *
 * Part 0 of a message is an rso_head, then n_arrays times an rso_array, then the texts that they point to. All numbers are
 * little-endian. On a big-endian processor swap the bytes of each field. docs/protocol.md explains the fields.
 *
 * The image of a camera, which a client asks for with "cameras": ["nav"] in its hello, has two entries:
 * "camera/nav/intensity_counts", dtype "<u2", n_dims 3, shape {rows, columns, bands, 1}, and
 * "camera/nav/exposure_s", dtype "<f8", n_dims 0, shape {1, 1, 1, 1}.
 */
#ifndef RSO_STRUCT_HEAD_H
#define RSO_STRUCT_HEAD_H
#include <stdint.h>

enum rso_reply {
    RSO_ERROR, RSO_HELLO, RSO_DESCRIBE, RSO_STEP, RSO_RESET, RSO_OBSERVATION, RSO_TRUTH, RSO_SAVE, RSO_RESTORE, RSO_SHUTDOWN
};
enum rso_frame_status { RSO_NO_FRAME, RSO_DELIVERED, RSO_DROPPED, RSO_SKIPPED };
enum rso_error { RSO_NO_ERROR, RSO_BAD_REQUEST, RSO_NO_SESSION, RSO_BUSY, RSO_FORBIDDEN, RSO_FAILED };
enum rso_flags { RSO_OK = 1, RSO_OVER = 2 };

struct rso_head {
    char magic[4]; /* "RSOL"; a JSON head begins with '{' */
    uint8_t version, reply, frame_status, flags;
    uint64_t sequence, request_sequence;
    int64_t time_ns, next_flash_ns, t_emission_ns, t_available_ns; /* -1 for none */
    uint64_t value;                                                /* seed of a reset, number of a saved state */
    uint32_t frame_index, overruns, dropped, error_code;
    uint32_t error_at; /* offset of the message of an error from the beginning of the head; 0 for none */
    uint32_t n_arrays;
};

struct rso_array {
    uint32_t name_at; /* offset of its path from the beginning of the head, ended by a zero byte */
    char dtype[4];    /* such as "<f4" */
    uint32_t n_dims, shape[4];
    uint32_t part; /* of the message that holds its values */
};

/* A compiler that lays the structures out otherwise refuses these. */
typedef char rso_head_has_88_bytes[sizeof(struct rso_head) == 88 ? 1 : -1];
typedef char rso_array_has_32_bytes[sizeof(struct rso_array) == 32 ? 1 : -1];

#endif
