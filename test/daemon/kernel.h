// SPDX-License-Identifier: MIT
/// The Linux kernel for the gateway's process, in virtual time: descriptors, files, sockets, a CAN interface, a GPIO line.
///
/// The linker leads every system call of the gateway here (`--wrap`, list in CMakeLists.txt); its own objects run unchanged, including
/// `main`. One process lives at a time. Its actions consume virtual time only here, in a call, so calls are the only instants
/// at which two runs can differ from outside. In each call
///
/// - time passes, the outside world goes on (daemon_world.h), and the process may be stopped, or preempted
/// - the process may be killed, before or after the call takes effect
/// - the call may fail, with an errno that its manual page names
///
/// Child processes do not run; their outside effects are simulated (the store process finds no file and writes none, the black box's
/// writer accepts its orders, the purging process sets the link down and up). There is one kernel, because libc has no context.
#ifndef DAEMON_KERNEL_H
#define DAEMON_KERNEL_H

#include "iwheel/can_frame.h"
#include "iwheel/hal.h"
#include "iwheel_sim/random.h"

#include <setjmp.h>
#include <sys/types.h>

#define VK_INTERFACE "can0"
#define VK_MARKER    "/run/iwheel/can0.armed"
#define VK_GATEWAY   "/run/iwheel/gateway.sock"
#define VK_WATCHERS  "/run/iwheel/watch.sock"
#define VK_LINE      "ESTOP"
/// The bytes of a connection that wait for the gateway, or for the client.
#define VK_IN_SIZE  16384U
#define VK_OUT_SIZE 65536U
#define VK_STREAMS  8U

/// How a life ended.
typedef enum { VK_EXITED, VK_KILLED, VK_OVER } vk_end_t;

/// A client's connection; its number identifies it.
typedef struct {
    bool used;       ///< In use by a client.
    bool watches;    ///< Connected to the socket for watchers.
    bool waiting;    ///< Not accepted yet.
    bool shut;       ///< The client will send no more.
    bool client_end; ///< The client has closed.
    bool closed;     ///< The gateway has closed, or died.
    size_t in_length;
    size_t out_length;
    uint64_t in_total; ///< Bytes that the gateway has read.
    char in[VK_IN_SIZE];
    char out[VK_OUT_SIZE];
} vk_stream_t;

typedef struct {
    iw_time_us_t now_us;
    iw_time_us_t stolen_us;    ///< Time in which the process was ready and did not run, since the beginning.
    iw_time_us_t stop_us;      ///< Stopped until then.
    iw_time_us_t suspended_us; ///< Time that CLOCK_MONOTONIC has not counted.
    int64_t wall_off_us;       ///< Offset of the wall clock.
    iw_time_us_t end_us;       ///< The life ends there as VK_OVER.
    uint64_t calls;            ///< Calls of all lives.
    uint64_t waits;            ///< Waits of the loop, contained in `calls`.
    uint64_t failed;           ///< Calls that the test made fail, contained in `calls`.
    uint64_t kill_at;          ///< The process is killed in the call with this number; 0: in none.
    bool kill_after;           ///< After it has taken effect.
    bool doomed;               ///< It is killed before the call has an effect.
    iw_time_us_t failed_us;    ///< When a call was made to fail last.
    iw_time_us_t failed_stolen_us;
    bool marker_failed;     ///< The last call on the crash marker failed.
    uint32_t fail_permille; ///< Calls that fail.
    uint32_t late_us;       ///< Maximum delay of each wake-up.
    bool no_descriptors;    ///< No descriptor is available.
    bool trace;
    sim_random_t random;
    int signal; ///< Pending, or 0.
    int exit_code;
    struct {
        bool exists;
        bool up;
        bool off; ///< Bus-off.
        bool may_restart;
        int index;
        int news;    ///< Events that the netlink socket has not reported yet.
        pid_t child; ///< The process that purges; 0: none.
        iw_time_us_t down_at_us;
        iw_time_us_t up_at_us;
        int child_status;
    } link;
    struct {
        bool there;
        int number; ///< Changes after the chip was gone: a descriptor of the earlier chip reads nothing any more.
        bool pressed;
        int edges; ///< Edges that were not read yet.
    } button;
    vk_stream_t stream[VK_STREAMS];
    bool bound_drive; ///< The socket is bound.
    bool bound_watch;
    bool alive;
    jmp_buf leave;
} vk_t;

extern vk_t vk;

void vk_begin(uint64_t seed, iw_time_us_t now_us, const char *config);

/// Runs the gateway from `main` until it ends, is killed, or the time is over. Its descriptors close; files and link stay.
vk_end_t vk_live(void);

/// Lets time pass without a process.
void vk_idle(iw_time_us_t for_us);

/// Lets time pass until then, with all events outside. Only in a call of the process.
void vk_pass(iw_time_us_t to_us);

/// Connects a client. Returns its number, or -1: no listener, or no free connection.
int vk_connect(bool watches);

/// Puts a frame on the bus; `echo`: it is the gateway's own.
void vk_deliver(const iw_can_frame_t *frame, bool echo);
/// Delivers an error frame of these classes and, in byte 1, this state of the controller.
void vk_deliver_error(uint32_t classes, uint8_t state);

void vk_link_up(bool up);
void vk_link_exist(bool exists);

void vk_press(bool pressed);

bool vk_file_exists(const char *path);

/// A call fails, or may fail.
void vk_note_failure(void);

// For the parts of the kernel ---------------------------------------------------------------------------------------

typedef enum {
    VK_FREE = 0,
    VK_FILE,
    VK_EPOLL,
    VK_SIGNAL,
    VK_LISTENER,
    VK_STREAM,
    VK_SOCKET, ///< Not bound, or a socket whose messages have no receiver.
    VK_CAN,
    VK_NETLINK,
    VK_GPIO,
    VK_CHILD,
} vk_kind_t;

typedef struct {
    vk_kind_t kind;
    int number;    ///< Number of the file, the stream, the CAN socket or the epoll set; family of a socket.
    size_t offset; ///< Position in a file.
    bool locked;
    bool events; ///< A netlink socket that receives changes.
    char name[96];
} vk_fd_t;

vk_fd_t *vk_fd(int fd);
/// Returns and clears the pending error of this CAN socket; 0: none.
int vk_take_can_error(int fd);

/// Begins a call. Returns false if it fails; errno is then one of `errors` (ended by 0; NULL: it cannot fail).
bool vk_call(const char *name, const int *errors);
/// Ends the call.
long vk_done(long result);
/// As `vk_call`, with a new descriptor. Returns -1 if it failed.
int vk_open_fd(const char *name, vk_kind_t kind, int number);
/// Returns the events that epoll would report.
uint32_t vk_ready(int fd);
uint32_t vk_ready_socket(const vk_fd_t *entry);
void vk_close_socket(const vk_fd_t *entry);
ssize_t vk_read_signal(void *out, size_t size);
int vk_make_socket_file(const char *name);
const char *vk_path_of(int file);
void vk_files_begin(const char *config);
void vk_forget_sockets(void);
void vk_set_carrier(void);

#endif
