/* A PLC on libmodbus: claims the right to write, triggers, and reads back. Exits with 0 where all was as it has to be.

   usage: libmodbus_client HOST PORT */
#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>

static modbus_t *plc;

static void expect(int holds, const char *what) {
    if (holds) return;
    fprintf(stderr, "%s: %s\n", what, modbus_strerror(errno));
    exit(1);
}

static void expect_exception(int result, int code, const char *what) {
    expect(result == -1 && errno == MODBUS_ENOBASE + code, what);
}

int main(int count, char **values) {
    uint16_t words[125], scan[2] = {3, 78};
    uint8_t bits[16];
    if (count != 3) return 2;
    plc = modbus_new_tcp(values[1], atoi(values[2]));
    expect(plc != NULL && modbus_set_slave(plc, 1) == 0 && modbus_connect(plc) == 0, "connect");

    expect(modbus_read_registers(plc, 241, 1, words) == 1 && words[0] == 0x1234, "the reference by 03");
    expect(modbus_read_input_registers(plc, 244, 2, words) == 2, "the long reference by 04");
    expect(words[0] == 0x1234 && words[1] == 0x5678, "the high word first");
    expect(modbus_read_registers(plc, 246, 2, words) == 2, "the float reference");
    float reference = modbus_get_float_abcd(words);
    expect(reference > 12.33f && reference < 12.35f, "the float as ABCD");

    expect_exception(modbus_write_register(plc, 1, 7), MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY, "06 without the key");
    expect(modbus_write_register(plc, 26, 0x5AFE) == 1, "the key");
    expect(modbus_write_registers(plc, 0, 2, (uint16_t[]){1, 77}) == 2, "arming by 16");
    expect(modbus_write_bit(plc, 3, TRUE) == 1, "a flag by 05");
    expect(modbus_read_bits(plc, 0, 9, bits) == 9 && bits[0] && !bits[1] && bits[3], "the flags by 01");
    expect(modbus_read_input_bits(plc, 1600, 16, bits) == 16, "the status by 02");
    expect(modbus_write_bits(plc, 3, 1, (uint8_t[]){0}) == 1, "a flag by 15");
    expect(modbus_mask_write_register(plc, 0, 0xFFFF, 0x0008) == 1, "a flag by 22");
    expect(modbus_write_and_read_registers(plc, 0, 2, scan, 0, 58 - 31, words) == 27, "a scan by 23");
    expect(words[0] == 3 && words[1] == 78, "what the scan wrote");
    expect(modbus_read_registers(plc, 100, 58, words) == 58, "status and result in one read");

    expect_exception(modbus_read_registers(plc, 60, 1, words), MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS, "02 unmapped");
    expect_exception(modbus_write_register(plc, 100, 1), MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS, "02 read only");
    expect_exception(modbus_write_register(plc, 2, 1), MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE, "03 half a value");
    expect_exception(modbus_report_slave_id(plc, sizeof bits, bits), MODBUS_EXCEPTION_ILLEGAL_FUNCTION, "01");
    modbus_set_slave(plc, 9);
    expect_exception(modbus_read_registers(plc, 241, 1, words), MODBUS_EXCEPTION_GATEWAY_TARGET, "0B another unit");
    modbus_close(plc);
    modbus_free(plc);
    return 0;
}
