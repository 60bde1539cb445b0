/* A Modbus TCP server on libmodbus, as its documentation builds one for several clients: select() over all of them.

   usage: libmodbus_server HOST PORT */
#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/select.h>
#include <unistd.h>

int main(int count, char **values) {
    if (count != 3) return 2;
    modbus_t *context = modbus_new_tcp(values[1], atoi(values[2]));
    modbus_mapping_t *mapping = modbus_mapping_new(0, 0, 512, 0);
    int listener = modbus_tcp_listen(context, 64), highest = listener;
    if (listener < 0) return 1;
    fd_set all, ready;
    FD_ZERO(&all);
    FD_SET(listener, &all);
    for (;;) {
        ready = all;
        if (select(highest + 1, &ready, NULL, NULL, NULL) < 0) return 1;
        for (int each = 0; each <= highest; each++) {
            if (!FD_ISSET(each, &ready)) continue;
            if (each == listener) {
                int client = modbus_tcp_accept(context, &listener);
                if (client < 0) continue;
                FD_SET(client, &all);
                if (client > highest) highest = client;
                continue;
            }
            uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
            modbus_set_socket(context, each);
            int size = modbus_receive(context, query);
            if (size > 0) {
                modbus_reply(context, query, size, mapping);
            } else if (size < 0) {
                close(each);
                FD_CLR(each, &all);
            }
        }
    }
}
