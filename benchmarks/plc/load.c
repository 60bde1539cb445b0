/* Modbus TCP clients of a benchmark: each reads registers in turn, in a closed loop or once a scan.

   usage: load HOST PORT CLIENTS SECONDS SCAN_US
   SCAN_US 0 is a closed loop. Prints "replies per second, p50, p99 and the worst latency in microseconds". */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define MOST_CLIENTS 64
#define MOST_SAMPLES 4000000
#define REPLY_BYTES (9 + 2 * 20)

struct client {
    int socket, got;
    uint16_t transaction;
    double sent_s, due_s;
    int waiting;
};

static uint8_t reply[512];
static float *latencies;
static long samples;

static double now_s(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec + 1e-9 * time.tv_nsec;
}

static void fail(const char *what) {
    perror(what);
    exit(1);
}

static void ask(struct client *client) {
    uint8_t request[12] = {0, 0, 0, 0, 0, 6, 1, 3, 0, 100, 0, 20};
    client->transaction++;
    request[0] = client->transaction >> 8;
    request[1] = client->transaction & 0xFF;
    client->got = 0;
    client->waiting = 1;
    client->sent_s = now_s();
    if (send(client->socket, request, sizeof request, 0) != sizeof request) fail("send");
}

/* Whether the reply is complete. */
static int hear(struct client *client) {
    ssize_t size = recv(client->socket, reply, sizeof reply, 0);
    if (size <= 0) fail("recv");
    if (client->got == 0 && size >= 2 && (reply[0] << 8 | reply[1]) != client->transaction) {
        fprintf(stderr, "a reply to another request\n");
        exit(1);
    }
    client->got += size;
    if (client->got < REPLY_BYTES) return 0;
    if (client->got > REPLY_BYTES) {
        fprintf(stderr, "%d bytes instead of %d\n", client->got, REPLY_BYTES);
        exit(1);
    }
    client->waiting = 0;
    if (samples < MOST_SAMPLES) latencies[samples] = 1e6 * (now_s() - client->sent_s);
    samples++;
    return 1;
}

static int ascending(const void *a, const void *b) {
    float left = *(const float *)a, right = *(const float *)b;
    return (left > right) - (left < right);
}

int main(int count, char **values) {
    if (count != 6) return 2;
    int clients = atoi(values[3]);
    double duration_s = atof(values[4]), scan_s = 1e-6 * atof(values[5]);
    struct client all[MOST_CLIENTS] = {0};
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(atoi(values[2]))};
    if (clients < 1 || clients > MOST_CLIENTS || inet_pton(AF_INET, values[1], &address.sin_addr) != 1) return 2;
    latencies = malloc(MOST_SAMPLES * sizeof *latencies);
    /* The instrument must not be what is measured; without the right to it everybody's figures suffer alike. */
    sched_setscheduler(0, SCHED_RR, &(struct sched_param){.sched_priority = 20});
    int poll = epoll_create1(0), timer = timerfd_create(CLOCK_MONOTONIC, 0);
    struct epoll_event event = {.events = EPOLLIN, .data.u32 = MOST_CLIENTS};
    epoll_ctl(poll, EPOLL_CTL_ADD, timer, &event);
    double begin_s = now_s(), end_s = begin_s + duration_s;
    for (int i = 0; i < clients; i++) {
        int one = 1;
        all[i].socket = socket(AF_INET, SOCK_STREAM, 0);
        if (connect(all[i].socket, (struct sockaddr *)&address, sizeof address)) fail("connect");
        setsockopt(all[i].socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        event.data.u32 = i;
        epoll_ctl(poll, EPOLL_CTL_ADD, all[i].socket, &event);
        all[i].due_s = begin_s + 0.01 + scan_s * i / clients;
        if (scan_s == 0) ask(&all[i]);
    }
    while (now_s() < end_s) {
        if (scan_s > 0) {
            double next_s = end_s;
            for (int i = 0; i < clients; i++) {
                if (!all[i].waiting && all[i].due_s <= now_s()) {
                    ask(&all[i]);
                    while (all[i].due_s <= now_s()) all[i].due_s += scan_s;
                }
                if (!all[i].waiting && all[i].due_s < next_s) next_s = all[i].due_s;
            }
            struct itimerspec at = {.it_value = {(time_t)next_s, (long)(1e9 * (next_s - (time_t)next_s))}};
            timerfd_settime(timer, TFD_TIMER_ABSTIME, &at, NULL);
        }
        struct epoll_event ready[MOST_CLIENTS + 1];
        int number = epoll_wait(poll, ready, MOST_CLIENTS + 1, 1000);
        for (int i = 0; i < number; i++) {
            if (ready[i].data.u32 == MOST_CLIENTS) {
                uint64_t expirations;
                if (read(timer, &expirations, sizeof expirations) < 0) fail("read");
            } else if (hear(&all[ready[i].data.u32]) && scan_s == 0) {
                ask(&all[ready[i].data.u32]);
            }
        }
    }
    double took_s = now_s() - begin_s;
    long kept = samples < MOST_SAMPLES ? samples : MOST_SAMPLES;
    if (kept == 0) return 1;
    qsort(latencies, kept, sizeof *latencies, ascending);
    printf("%.0f %.1f %.1f %.1f\n", samples / took_s, latencies[kept / 2], latencies[(long)(0.99 * (kept - 1))],
           latencies[kept - 1]);
    return 0;
}
