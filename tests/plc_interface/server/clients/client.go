// A PLC on simonvetter/modbus: claims the right to write, triggers, and reads back. usage: client HOST:PORT
package main

import (
	"errors"
	"log"
	"os"
	"time"

	"github.com/simonvetter/modbus"
)

func must(err error) {
	if err != nil {
		log.Fatal(err)
	}
}

func expect(holds bool, what string) {
	if !holds {
		log.Fatal(what)
	}
}

func main() {
	plc, err := modbus.NewClient(&modbus.ClientConfiguration{URL: "tcp://" + os.Args[1], Timeout: 20 * time.Second})
	must(err)
	must(plc.SetUnitId(1))
	must(plc.Open())
	long, err := plc.ReadUint32(244, modbus.HOLDING_REGISTER)
	must(err)
	expect(long == 0x12345678, "the long reference")
	float, err := plc.ReadFloat32(246, modbus.INPUT_REGISTER)
	must(err)
	expect(float > 12.33 && float < 12.35, "the float reference")
	must(plc.WriteRegister(26, 0x5AFE))
	must(plc.WriteRegisters(0, []uint16{1, 80}))
	must(plc.WriteUint32(2, 4711))
	must(plc.WriteCoil(3, true))
	coils, err := plc.ReadCoils(0, 9)
	must(err)
	expect(coils[0] && coils[3] && !coils[1], "the flags")
	err = plc.WriteRegister(2, 1)
	expect(errors.Is(err, modbus.ErrIllegalDataValue), "03 half a value")
	_, err = plc.ReadRegister(60, modbus.HOLDING_REGISTER)
	expect(errors.Is(err, modbus.ErrIllegalDataAddress), "02 unmapped")
	must(plc.Close())
}
